"""A page to look at: one HTML file that needs no network and no second file.

Every function takes plain text, escapes it and gives back HTML; `html_page` puts the pieces together.
"""

import base64
import hashlib
import html
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from placerec.errors import EvaluationError

_STYLE = """
:root { color-scheme: light dark; --ink: #1d1d1f; --soft: #5c5c64; --line: #d4d4da; --shade: #f3f3f6; --page: #fff; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e6ea; --soft: #a2a2ac; --line: #3d3d46; --shade: #25252b; --page: #17171a; }
}
body { max-width: 76rem; margin: 3rem auto; padding: 0 1.25rem; background: var(--page); color: var(--ink);
       font: 1.0625rem/1.6 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1, h2, h3 { line-height: 1.25; margin: 2.2em 0 .6em; }
h1 { font-size: 2rem; margin-top: 0; }
h2 { font-size: 1.35rem; border-top: 1px solid var(--line); padding-top: 1.1em; }
h3 { font-size: 1.1rem; }
p { max-width: 44rem; }
figure { margin: 1.8rem 0; overflow-x: auto; }
figure img { max-width: 100%; height: auto; background: #fff; border-radius: 4px; }
figcaption, caption { color: var(--soft); font-size: .9rem; text-align: left; padding: .5rem 0; max-width: 44rem; }
table { border-collapse: collapse; font-size: .95rem; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
th { font-weight: 600; }
.number { text-align: right; }
.yes::before { content: "\\25cf  "; color: #009e73; }
.no::before { content: "\\2715  "; color: #d55e00; }
.open::before { content: "\\25cb  "; color: #cc79a7; }
.yes { background: #009e7322; } .no { background: #d55e0022; } .open { background: #cc79a71a; }
.none { color: var(--soft); }
pre { background: var(--shade); border-radius: 4px; padding: .8rem 1rem; overflow-x: auto; font-size: .9rem;
      line-height: 1.5; font-family: ui-monospace, "SF Mono", Menlo, Consolas, "DejaVu Sans Mono", monospace; }
@media screen and (max-width: 40rem) { figure > img { max-width: 46rem; } }
@media print { body { margin: 0; max-width: none; } figure, table { break-inside: avoid; } }
""".strip()

# The browser itself then refuses whatever would leave the file, and every script but the page's own.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

# What a cell of a table may be marked as.
Mark = Literal["yes", "no", "open", "none"]
_NO_MARKS: Mapping[str, Mark] = MappingProxyType({})

_KINDS = ((b"\x89PNG\r\n\x1a\n", "image/png"), (b"\xff\xd8\xff", "image/jpeg"))


def html_page(title: str, body: Iterable[str], *, style: str = "", script: str = "") -> str:
    """A whole page: `title` as text, `body` as pieces of HTML from the functions below.

    `style`: CSS behind that of all pages; `script`: JavaScript that is run when the page is there, and the only one
    that the browser lets run.
    """
    name, pieces = html.escape(title), "\n".join(body)
    policy = _POLICY
    if script:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
        policy += f"; script-src 'sha256-{digest}'"
        script = f'<script type="module">{script}</script>\n'
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{name}</title>
<style>
{_STYLE}
{style}</style>
</head>
<body>
<h1>{name}</h1>
{pieces}
{script}</body>
</html>
"""


def heading(text: str, level: int = 2) -> str:
    """A heading; the page's title is level 1."""
    return f"<h{level}>{html.escape(text)}</h{level}>"


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{html.escape(text)}</p>"


def preformatted(text: str) -> str:
    """Commands or a program's output, line by line as they are."""
    return f"<pre>{html.escape(text)}</pre>"


def picture(image: Path | str | bytes, alt: str, caption: str, *, narrow: Path | str | bytes | None = None) -> str:
    """A PNG, JPEG or SVG picture, kept inside the page; `alt` is what someone who cannot see it is told.

    image: a file or its bytes; `narrow`: what stands in its place on a narrow screen. Raises EvaluationError if a file
    cannot be read or holds no such picture.
    """
    shown = f'<img src="{_address(image)}" alt="{html.escape(alt)}">'
    if narrow is not None:
        shown = f'<picture><source media="(max-width: 40rem)" srcset="{_address(narrow)}">{shown}</picture>'
    return f"<figure>{shown}\n<figcaption>{html.escape(caption)}</figcaption></figure>"


def _address(image: Path | str | bytes) -> str:
    """The picture itself, where its address would stand."""
    source = "the picture" if isinstance(image, bytes) else str(image)
    try:
        data = image if isinstance(image, bytes) else Path(image).read_bytes()
    except OSError as error:
        raise EvaluationError(f"{source}: cannot be read: {error.strerror}") from error
    kind = next((kind for magic, kind in _KINDS if data.startswith(magic)), "")
    if not kind and b"<svg" not in data[:1000]:
        raise EvaluationError(f"{source}: neither PNG, JPEG nor SVG; pages hold no other pictures")
    return f"data:{kind or 'image/svg+xml'};base64,{base64.b64encode(data).decode('ascii')}"


def table(
    header: Sequence[str], rows: Iterable[Sequence[object]], caption: str, *, marks: Mapping[str, Mark] = _NO_MARKS
) -> str:
    """A table of texts and numbers; None is a dash, and columns without texts are set flush right.

    Numbers are written by `str`: whoever knows their unit rounds them. Cells that hold a text of `marks` get a sign and
    a colour. Raises ValueError if a row has another length than `header`.
    """
    body = [tuple(row) for row in rows]
    flush = [all(_numeric(row[column]) for row in body) for column in range(len(header))] if body else []
    lines = ["<figure><table>", f"<caption>{html.escape(caption)}</caption>"]
    lines.append(f"<thead>{_row(header, flush or [False] * len(header), 'th')}</thead>")
    lines += ["<tbody>", *(_row(row, flush, "td", marks) for row in body), "</tbody>", "</table></figure>"]
    return "\n".join(lines)


def _row(cells: Sequence[object], flush: Sequence[bool], tag: str, marks: Mapping[str, Mark] = _NO_MARKS) -> str:
    kind = f'{tag} scope="col"' if tag == "th" else tag
    texts = []
    for cell, right in zip(cells, flush, strict=True):
        text = "–" if cell is None else html.escape(str(cell))
        look = marks.get(str(cell)) or ("number" if right else None)
        texts.append(f'<{kind} class="{look}">{text}</{tag}>' if look else f"<{kind}>{text}</{tag}>")
    return f"<tr>{''.join(texts)}</tr>"


def _numeric(cell: object) -> bool:
    """Also `87.3 %` and `12 ms`: what starts like a number is compared like one."""
    return cell is None or isinstance(cell, int | float) or str(cell).lstrip("+-−±~<> ")[:1].isdigit()
