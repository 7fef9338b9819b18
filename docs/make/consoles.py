"""Run the console blocks of a page as a reader would, and put what they print where the page shows it.

python docs/make/consoles.py docs/tutorial.md FOLDER    # writes the page anew; FOLDER keeps what the commands made

Lines that begin with "$ " are commands of a shell; those below them are what they print, on either stream. A block
with title="NAME" is written to the file NAME first. `docs` in FOLDER leads to this one, `python` is the running one.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r'^```(console|\w+ title="([^"\n]+)")\n(.*?)^```$', re.MULTILINE | re.DOTALL)
SHELL = 'python() { "$PYTHON" "$@"; }\nplacerec() { "$PYTHON" -m placerec "$@"; }\n'


def rerun(page: str, folder: Path) -> str:
    """The page with what its commands print today, all run one after the other in `folder`."""
    if not (folder / "docs").exists():
        (folder / "docs").symlink_to(DOCS, target_is_directory=True)

    def again(match: re.Match[str]) -> str:
        if match[2]:
            (folder / match[2]).write_text(match[3], encoding="utf-8")
            return match[0]
        commands = re.findall(r"^\$ (.*(?:\\\n.*)*)\n", match[3], re.MULTILINE)
        return "```console\n" + "".join(f"$ {each}\n{printed(each, folder)}" for each in commands) + "```"

    return BLOCK.sub(again, page)


def printed(command: str, folder: Path) -> str:
    """What a command prints, without the blanks at the ends of lines."""
    settings = {"PYTHON": sys.executable, "COLUMNS": "80", "OPENBLAS_NUM_THREADS": "1", "LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        ["sh", "-c", SHELL + command],
        cwd=folder,
        env=os.environ | settings,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
    )
    return re.sub(r"[ \t]+$", "", done.stdout, flags=re.MULTILINE)


if __name__ == "__main__":
    page, folder = Path(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    page.write_text(rerun(page.read_text(encoding="utf-8"), folder), encoding="utf-8")
