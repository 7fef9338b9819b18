"""Pages: one file that says what it was given, and fetches nothing."""

import base64
from html.parser import HTMLParser
from pathlib import Path

import pytest

from placerec.errors import EvaluationError
from placerec.figures.pages import heading, html_page, paragraph, picture, preformatted, table

PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(40))
NASTY = "<script>alert(\"1\")</script> & 'two'"


class Page(HTMLParser):
    """What a browser would see: elements with their attributes, and the text; refuses elements that do not nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data

    def attributes(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def whole() -> str:
    parts = [heading(NASTY), heading(NASTY, 3), paragraph(NASTY), preformatted(NASTY), picture(PNG, NASTY, NASTY)]
    return html_page(NASTY, [*parts, table([NASTY, "n"], [[NASTY, 1]], NASTY)])


def test_all_texts_are_escaped() -> None:
    page = Page(whole())
    assert not page.attributes("script")
    # The title twice, then heading, heading, paragraph, commands, caption, and the table's caption, header and cell.
    assert page.text.count(NASTY) == 10
    assert page.attributes("img")[0]["alt"] == NASTY


def test_nothing_refers_outside() -> None:
    text = whole()
    page = Page(text)
    for _, attributes in page.elements:
        for name in ("src", "href", "srcset", "action", "data"):
            assert (attributes.get(name) or "data:").startswith("data:")
    assert not {"link", "script", "iframe", "object"} & {tag for tag, _ in page.elements}
    assert "url(" not in text
    assert "@import" not in text
    assert "http:" not in text
    assert "https:" not in text


def test_a_page_is_for_readers_of_all_kinds() -> None:
    page = Page(whole())
    assert page.attributes("html") == [{"lang": "en"}]
    assert {"charset": "utf-8"} in page.attributes("meta")
    assert all(image["alt"] for image in page.attributes("img"))
    assert "prefers-color-scheme: dark" in page.text
    assert [attributes["scope"] for attributes in page.attributes("th")] == ["col", "col"]


def test_a_picture_is_inside_the_page(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(PNG)
    encoded = "data:image/png;base64," + base64.b64encode(PNG).decode()
    for image in (PNG, tmp_path / "a.png", str(tmp_path / "a.png")):
        assert Page(picture(image, "x", "y")).attributes("img")[0]["src"] == encoded


@pytest.mark.parametrize(
    ("data", "kind"),
    [(b"\xff\xd8\xff\xe0", "image/jpeg"), (b'<?xml version="1.0"?><svg>', "image/svg+xml"), (PNG, "image/png")],
)
def test_the_kind_of_a_picture_is_told_by_its_bytes(data: bytes, kind: str) -> None:
    assert f'src="data:{kind};base64,' in picture(data, "x", "y")


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("hello")
    with pytest.raises(EvaluationError) as raised:
        picture(tmp_path / "a.png", "x", "y")
    assert str(raised.value) == f"{tmp_path / 'a.png'}: neither PNG, JPEG nor SVG; pages hold no other pictures"
    with pytest.raises(EvaluationError, match=r"b.png: cannot be read: No such file"):
        picture(tmp_path / "b.png", "x", "y")


def test_columns_of_numbers_are_set_flush_right() -> None:
    header = ["method", "accuracy", "frames", "remark"]
    rows: list[list[object]] = [
        ["hohmm", "87.3 %", 120, "one"],
        ["5th", None, -3.5, "2 words"],
        ["x", "~1", 0, "three"],
    ]
    page = Page(table(header, rows, "c"))
    assert [attributes.get("class") for attributes in page.attributes("th")] == [None, "number", "number", None]
    assert [attributes.get("class") for attributes in page.attributes("td")] == [None, "number", "number", None] * 3
    assert "–" in page.text


def test_a_table_may_have_no_rows_but_no_ragged_ones() -> None:
    assert Page(table(["a", "b"], [], "c")).text.split() == ["c", "ab"]
    with pytest.raises(ValueError, match="zip"):
        table(["a", "b"], [[1, 2, 3]], "c")


def test_the_same_parts_give_the_same_page() -> None:
    assert whole() == whole()


def test_what_a_cell_says_can_have_a_mark() -> None:
    made = table(["claim", "verdict"], [["O1", "holds"], ["O2", "<b>"]], "All", marks={"holds": "yes", "<b>": "no"})
    assert '<td>O1</td><td class="yes">holds</td>' in made
    assert '<td class="no">&lt;b&gt;</td>' in made
