"""From images to a model in one go: `placerec learn`."""

from pathlib import Path
from typing import Any

import click

from placerec.cli import shared


@shared.command("learn", epilog="Example: placerec learn RUNS/ -o model/ --test RUNS/run3")
@shared.source_arguments
@click.option(
    "--test",
    metavar="RUN",
    multiple=True,
    type=shared.PATH,
    help="A run that trains nothing, and is decoded and judged; it may be one of RUNS.  [repeatable]",
)
@shared.dictionary_options
@shared.model_options
@shared.descriptor_options
@shared.output_option("MODEL/", "The folder to write: words.npz, tokens/, and all that train-lm writes.")
@shared.cache_option
@shared.work_options
@shared.talk_options
def learn(sources: tuple[Path, ...], out: Path, **how: Any) -> None:
    """Learn words, models and how much words weigh, in one go.

    What train-words, tokenize and train-lm would write, every frame described once; SOURCE is what they take. How much
    words weigh (alpha) and how fast the filter forgets (memory) is judged on each group of sequences by what the others
    alone teach; a view that every group is better without is left out. `placerec decode IMAGES -m MODEL/` then needs no
    -w.
    """
    from placerec.learning import format_learned, learn as run

    with shared.progress_bar("describe") as progress:
        learned = run(sources, out, progress=progress, **how)
    click.echo(format_learned(learned))
