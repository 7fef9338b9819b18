"""The grammars of docs/files.md as regular expressions: none of them is recursive."""

import re
from collections.abc import Callable

TOKEN = re.compile(
    r'\s*(?:"(?P<text>[^"]*)"|/(?P<regex>(?:\\.|[^/\\])+)/|(?P<name>[A-Za-z][\w.-]*)|(?P<mark>[=|(){}\[\]]))'
)


def read_grammars(page: str) -> dict[str, str]:
    """Name -> regular expression, of everything that the page's ebnf blocks define, in any order."""
    rules: dict[str, list[tuple[str, str]]] = {}
    for block in re.findall(r"^```ebnf\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        # A definition begins at the left; what is indented goes on with it.
        for definition in re.split(r"\n(?=\S)", block):
            (kind, name), (_, equals), *rest = tokens(definition)
            assert (kind, equals) == ("name", "="), definition
            assert name not in rules, f"{name} is defined twice"
            rules[name] = rest
    return {name: expanded(name, rules, ()) for name in rules}


def tokens(text: str) -> list[tuple[str, str]]:
    """Kind and text of each token."""
    found, at = [], 0
    while text[at:].strip():
        match = TOKEN.match(text, at)
        assert match is not None, f"what is this? {text[at : at + 40]!r}"
        found.append((str(match.lastgroup), match[str(match.lastgroup)]))
        at = match.end()
    return found


def expanded(name: str, rules: dict[str, list[tuple[str, str]]], above: tuple[str, ...]) -> str:
    """The regular expression of a name, with those of the names that it uses in place."""
    assert name in rules, f"{name} is not defined"
    assert name not in above, f"{name} is defined by itself"
    marks = {"{": "(?:", "}": ")*", "[": "(?:", "]": ")?", "(": "(?:", ")": ")", "|": "|"}
    parts: dict[str, Callable[[str], str]] = {
        "text": re.escape,
        "regex": lambda value: f"(?:{value})",
        "name": lambda value: expanded(value, rules, (*above, name)),
        "mark": marks.__getitem__,
    }
    return f"(?:{''.join(parts[kind](value) for kind, value in rules[name])})"
