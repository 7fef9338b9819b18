"""Numbers at the start of a text, as the C library reads them: None where there is none."""

import math
import re


def leading_int(text: str) -> int | None:
    """The number that C's strtol with base 0 finds at the start of a text: 12, 0x1f, 017; None if there is none."""
    match = re.match(rf"{_SPACE}([-+]?)(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)", text)
    if not match:
        return None
    digits = match[2]
    base = 16 if digits[:2].lower() == "0x" else 8 if digits.startswith("0") and len(digits) > 1 else 10
    value = bounded_int(digits[2:] if base == 16 else digits, base)
    return -value if match[1] == "-" else value


def bounded_int(digits: str, base: int = 10, *, most: int = 2**63 - 1) -> int:
    """The number that digits spell, at most `most`; there may be more digits than Python cares to convert."""
    digits = digits.lstrip("0")
    return min(int(digits or "0", base), most) if len(digits) <= _MOST_DIGITS else most


def leading_float(text: str) -> float | None:
    """The number that C's strtod finds at the start of a text, None if there is none."""
    match = re.match(rf"{_SPACE}([-+]?(?:{_HEXADECIMAL}|{_DECIMAL}|inf(?:inity)?|nan))", text, re.IGNORECASE)
    if not match:
        return None
    if "x" not in match[1].lower():
        return float(match[1])
    try:
        return float.fromhex(match[1])
    except OverflowError:
        return -math.inf if match[1].startswith("-") else math.inf


def whole_float(text: str) -> float | None:
    """The number that a text is, as C's strtod reads it to the end; None if there is more or less to the text."""
    match = re.fullmatch(rf"{_SPACE}[-+]?(?:{_HEXADECIMAL}|{_DECIMAL}|inf(?:inity)?|nan)", text, re.IGNORECASE)
    return leading_float(text) if match else None


_MOST_DIGITS = 1000
_SPACE = r"[ \t\n\v\f\r]*"
_HEXADECIMAL = r"0x(?:[0-9a-f]+\.?[0-9a-f]*|\.[0-9a-f]+)(?:p[-+]?[0-9]+)?"
_DECIMAL = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?"
