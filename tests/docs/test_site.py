"""The site: it builds without a warning, loads nothing from a network, and its links lead somewhere."""

import importlib.util
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
PARTS = ("mkdocs", "material", "mkdocstrings", "mkdocstrings_handlers")


class Page(HTMLParser):
    """What a page loads by itself, where its links lead, and the places that links can lead to."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """One element."""
        values = {key: value or "" for key, value in attrs}
        self.ids |= {values[key] for key in ("id", "name") if key in values}
        if tag == "link" and values.get("rel") in ("canonical", "prev", "next", "alternate"):
            return
        if tag == "a":
            self.links += [values["href"]] if "href" in values else []
        else:
            self.loads += [values[key] for key in ("src", "href", "srcset", "data", "poster") if key in values]
        if "style" in values:
            self.loads += re.findall(r"url\(([^)]*)\)", values["style"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site; whatever mkdocs has to say about it is an error."""
    if missing := [name for name in PARTS if importlib.util.find_spec(name) is None]:
        pytest.skip(f"the site needs {', '.join(missing)}: pip install '.[docs]'")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(ROOT / ".mkdocs.yml"), "-d", str(out)]
    # Material's banner about its own future is no warning about these pages.
    settings = {"NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | settings)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return out


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    found = {path: Page(path) for path in sorted(site.rglob("*.html"))}
    assert len(found) > len(PAGES) > 9
    return found


def test_every_page_of_docs_is_built_and_in_the_navigation(site: Path, pages: dict[Path, Page]) -> None:
    reached = {(site / unquote(link.partition("#")[0])).resolve() for link in pages[site / "index.html"].links}
    for page in PAGES:
        assert site / f"{page.stem}.html" in reached, page.name


def test_nothing_is_loaded_from_a_network(site: Path, pages: dict[Path, Page]) -> None:
    loads = [load for page in pages.values() for load in page.loads]
    assert len(loads) > 100
    assert [load for load in loads if urlsplit(load).scheme not in ("", "data") or load.startswith("//")] == []
    styles = sorted(site.rglob("*.css"))
    assert len(styles) >= 3
    for style in styles:
        text = style.read_text(encoding="utf-8")
        assert re.findall(r"@import|url\(\s*['\"]?(?:https?:)?//", text) == [], style.name


def test_no_page_has_what_makes_the_themes_script_ask_another_host(pages: dict[Path, Page]) -> None:
    """The script fetches what draws diagrams, and facts about a repository, where a page has one."""
    for path in pages:
        text = path.read_text(encoding="utf-8")
        assert text.count('id="__config"') == 1
        for asks in ('class="mermaid"', 'data-md-component="source"', '"provider":'):
            assert asks not in text, path.name


def test_search_has_its_index_and_its_worker_without_a_server(site: Path) -> None:
    assert (site / "search/search_index.js").read_text(encoding="utf-8").startswith("var __index = {")
    assert 'src="assets/iframe-worker.js"' in (site / "index.html").read_text(encoding="utf-8")


def test_links_within_the_site_lead_to_a_page_and_a_place_on_it(pages: dict[Path, Page]) -> None:
    checked = 0
    for path, page in pages.items():
        for link in page.links + page.loads:
            parts = urlsplit(link)
            if parts.scheme or path.name == "404.html":
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.is_file(), f"{path.name}: {link}"
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].ids, f"{path.name}: {link}"
            checked += 1
    assert checked > 1000


@pytest.mark.parametrize(
    "page", [*PAGES, ROOT / "README.md", ROOT / "arpa_models/README.md"], ids=lambda page: page.stem
)
def test_links_between_the_files_themselves_lead_to_files(page: Path) -> None:
    """As a reader on GitHub meets them, where nothing is rewritten."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        parts = urlsplit(link)
        if not parts.scheme and parts.path:
            assert (page.parent / unquote(parts.path)).exists(), link


def test_no_docstring_is_taken_for_html(site: Path) -> None:
    text = (site / "library.html").read_text(encoding="utf-8")
    assert "&lt;unk&gt;" in text
    assert re.findall(r"<(?:s|unk)>", text) == []


def test_the_library_page_has_every_public_name_once() -> None:
    import placerec

    text = (ROOT / "docs/library.md").read_text(encoding="utf-8")
    named = re.findall(r"^::: placerec\.(?:\w+\.)*(\w+)$", text, re.MULTILINE)
    assert sorted(named) == sorted(set(placerec.__all__) - {"__version__"})
