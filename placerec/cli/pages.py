"""Pages that answer: `placerec label`."""

from pathlib import Path
from typing import Any

import click

from placerec.cli import shared
from placerec.cli.shared.pages import ShowPage


@shared.command(epilog="Example: placerec label RUNS/run7 -m model/")
@shared.whole_source_arguments
@click.option("-m", "--model", metavar="MODEL/", type=shared.PATH, help="A folder of learn, which proposes labels.")
@shared.network_option
@shared.page_options
@shared.talk_options
def label(sources: tuple[Path, ...], show: ShowPage, **how: Any) -> None:
    """Label drives in the browser.

    SOURCE is a sequence or a folder of sequences: folders of images, videos, bags. The page shows a drive as a film
    over a time line; keys or the mouse say where it is in which place, and every change is saved at once: in places.lst
    in the folder, or in NAME.labels beside a video or bag. The address is the first line on stdout; Ctrl-C ends it.
    """
    from placerec.page.label import label_pages

    server = label_pages(sources, **how)
    show(server)
    server.run()
