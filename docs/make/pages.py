"""Hooks of .mkdocs.yml: programs and files outside docs/ that pages link to get pages, too, and no page is left out.

On GitHub such a link leads to the file itself. In the site `../arpa_models/README.md` is a page; a text that is not
Markdown gets a page that shows it, a folder one that shows its texts; `../README.md` is the first page.
"""

import os
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

LINK = re.compile(r"(?<!!)(\[[^\]\n]*\]\()([^)\s#:]+)((?:#[^)\s]*)?\))")
LANGUAGES = {".py": "python", ".json": "json"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files outside docs/ that pages link to; list what the navigation does not name under "More"."""
    root = Path(config.docs_dir).parent
    pages = [file.src_uri for file in files.documentation_pages()]
    queue = [(f"docs/{file.src_uri}", file.content_string) for file in files.documentation_pages()]
    while queue:
        source, text = queue.pop()
        for target in {outside(source, link, root) for _, link, _ in LINK.findall(text)} - {None, "README.md"}:
            if target and not files.get_file_from_path(page_of(target)):
                files.append(File.generated(config, page_of(target), content=shown(root, target)))
                queue.append((target, shown(root, target)))
    named = set(re.findall(r"'([^']+\.md)'", str(config.nav)))
    if config.nav and set(pages) - named:
        config.nav.append({"More": sorted(set(pages) - named)})
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links that leave docs/ (and, in files outside it, those that lead there) into links between pages."""
    root = Path(config.docs_dir).parent
    here = page.file.src_uri
    source = here if page.file.generated_by else f"docs/{here}"

    def led(match: re.Match[str]) -> str:
        target = outside(source, match[2], root)
        if target is None and not page.file.generated_by:
            return match[0]
        path = os.path.normpath(Path(source).parent / match[2]).removeprefix("docs/")
        return match[1] + os.path.relpath(page_of(target) if target else path, Path(here).parent) + match[3]

    return LINK.sub(led, markdown)


def outside(source: str, link: str, root: Path) -> str | None:
    """The path, from the repository's root, of the program, or the file outside docs/, that a link leads to."""
    target = os.path.normpath(Path(source).parent / link)
    served = target.startswith("docs/") and not target.endswith(".py")
    return None if served or target.startswith("..") or not (root / target).exists() else target


def page_of(target: str) -> str:
    """The page that shows a file."""
    target = target.removeprefix("docs/")
    return "index.md" if target == "README.md" else target if target.endswith(".md") else f"{target}.md"


def shown(root: Path, target: str) -> str:
    """Markdown as it is; another text in a block, a folder as the blocks of its texts."""
    path = root / target
    if path.suffix == ".md":
        return path.read_text(encoding="utf-8")
    if path.is_dir():
        texts = sorted(each for each in path.rglob("*.*") if each.is_file())
        return f"# {target}\n" + "".join(f"\n## {each.relative_to(path)}\n\n{block(each)}" for each in texts)
    return f"# {target}\n\n{block(path)}"


def block(path: Path) -> str:
    """A text between fences."""
    return f"````{LANGUAGES.get(path.suffix, 'text')}\n{path.read_text(encoding='utf-8')}````\n"
