"""Images and words: `placerec describe`, `train-words`, `tokenize`, `show-words`, `show-frame` and `stability`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from placerec.cli import shared
from placerec.errors import counted

if TYPE_CHECKING:
    from placerec.vision import DictionarySetOptions


@shared.command(epilog="Example: placerec describe COLD/seq1_cloudy1 -o descriptors.npz")
@shared.source_arguments
@shared.descriptor_options
@shared.output_option("descriptors.npz", "The file to write: arrays descriptors, frames, sequences, places, times.")
@shared.cache_option
@shared.work_options
@shared.talk_options
def describe(sources: tuple[Path, ...], out: Path, **how: Any) -> None:
    """Write the descriptor of every frame.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or as in COLD, KITTI, EuRoC and others), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    """
    from placerec.vision import describe_sources

    with shared.progress_bar("describe") as progress:
        describe_sources(sources, out, progress=progress, **how)


@shared.command("train-words", epilog="Example: placerec train-words RUNS/run1 RUNS/run2 -o words.npz --size 20")
@shared.source_arguments
@shared.dictionary_options
@shared.as_in_paper(
    shared.groups.word,
    "The paper's words: --views plain --size 10; options given beside it win.",
    views="plain",
    sizes="10",
)
@shared.groups.word(
    "--held-out",
    metavar="SOURCE",
    multiple=True,
    type=shared.PATH,
    help="Images that train nothing: how well the map represents them is told.  [repeatable]",
)
@shared.descriptor_options
@shared.output_option("words.npz", "The dictionary to write.")
@shared.cache_option
@shared.work_options
@shared.talk_options
def train_words(sources: tuple[Path, ...], out: Path, words: "DictionarySetOptions", **how: Any) -> None:
    """Learn visual words: PCA and maps of descriptors.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or as in COLD, KITTI, EuRoC and others), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    Or all SOURCEs are descriptors.npz of describe.
    """
    from placerec.vision import train_dictionary

    with shared.progress_bar("describe") as progress:
        train_dictionary(sources, out, options=words, progress=progress, **how)


@shared.command(epilog="Example: placerec tokenize RUNS/ -w words.npz -o tokens/")
@shared.source_arguments
@shared.words_option(True, "The dictionary of train-words.")
@shared.matrix_option
@shared.network_option
@shared.output_option("tokens/", "The folder to write: one .tsv per sequence, and vocab.txt.")
@shared.cache_option
@shared.work_options
@shared.talk_options
def tokenize(sources: tuple[Path, ...], words: Path, out: Path, **how: Any) -> None:
    """Write the visual word of every frame.

    SOURCE is a sequence, a folder of sequences, or a folder with one folder of images per place. A sequence is a
    folder of images (any, or as in COLD, KITTI, EuRoC and others), a video, or a bag of ROS 1 or 2 (.bag, .mcap, a
    folder with metadata.yaml). `-` reads a list from standard input, an image a line: path [TAB seconds [TAB place]].
    Or all SOURCEs are descriptors.npz of describe. A camera (camera:0, camera:rtsp://...) is recorded until Ctrl-C.
    """
    from placerec.words.tokenize import tokenize as run

    with shared.progress_bar("tokenize") as progress:
        run(sources, words, out, progress=progress, **how)


@shared.command("show-words", epilog="Example: placerec show-words words.npz RUNS/ -o words.png")
@click.argument("words", metavar="words.npz", type=shared.FILE)
@shared.source_arguments
@shared.dictionary_option
@shared.matrix_option
@shared.network_option
@shared.output_option("words.png", "Draw all words on one sheet: .png, .svg or .pdf.", required=False)
@shared.json_option("Print JSON, with a row for every unit of the map.")
@shared.cache_option
@shared.talk_options
def show_words(words: Path, sources: tuple[Path, ...], out: Path | None, as_json: bool, **how: Any) -> None:
    """Show the typical frame and place of each word.

    SOURCE is what tokenize takes: the frames to look at, of the training or of later runs. For every unit of the map
    the sheet shows the frame nearest to it, the place that most frames with this word have, and the training frames
    that hit it; and how far neighbouring units are from each other (U-matrix).
    """
    from placerec.inspection.word_sheet import show_words as run
    from placerec.inspection.words import format_words

    with shared.progress_bar("describe") as progress:
        table = run(words, sources, out, progress=progress, **how)
    shared.echo_json(table.to_json()) if as_json else click.echo(format_words(table))


@shared.command("show-frame", epilog="Example: placerec show-frame frame.png -w words.npz -o seen.png")
@click.argument("image", metavar="IMAGE", type=shared.FILE)
@click.argument("sources", metavar="[SOURCE...]", nargs=-1, type=shared.PATH)
@shared.reading_options()
@shared.words_option(True, "The dictionary of train-words.")
@shared.dictionary_option
@shared.network_option
@shared.output_option("seen.png", "Draw what the descriptor sees: .png, .svg or .pdf.", required=False)
@shared.json_option()
@shared.cache_option
@shared.talk_options
def show_frame(
    image: Path, sources: tuple[Path, ...], words: Path, out: Path | None, as_json: bool, **how: Any
) -> None:
    """Show what the dictionary sees in an image.

    The picture shows the image as it is fitted, how strong its edges are in each of the 4 x 4 windows by direction
    and scale, and the units of the map that are nearest to it. With SOURCE, which is what tokenize takes, it is told
    what these units look like, and which place they mostly belong to, among the frames there.
    """
    from placerec.inspection.frame import format_frame, show_frame as run

    with shared.progress_bar("describe") as progress:
        view = run(image, words, sources, out, progress=progress, **how)
    shared.echo_json(view.to_json()) if as_json else click.echo(format_frame(view))


@shared.command(epilog="Example: placerec stability RUNS/ -w words.npz -o stability.png")
@shared.source_arguments
@shared.words_option(True, "The dictionary of train-words.")
@shared.dictionary_option
@shared.network_option
@click.option(
    "--sample",
    metavar="N",
    type=click.IntRange(min=1),
    default=500,
    help="Frames to look at, drawn by the seed; all if there are fewer.",
)
@click.option("--light", is_flag=True, help="Look at the frames in the simulated lights of relight instead.")
@shared.seed_option("Seed of the sample, of the noise and of the light.")
@shared.output_option("stability.png", "Draw the table as bars: .png, .svg or .pdf.", required=False)
@shared.json_option()
@shared.work_options
@shared.talk_options
def stability(sources: tuple[Path, ...], words: Path, out: Path | None, as_json: bool, **how: Any) -> None:
    """Measure how stable the words are.

    SOURCE is what tokenize takes. Frames are spoilt by JPEG compression, noise, brightness, blur, a shift of one pixel
    and another resize filter, or looked at as they might be in other lights (simulated, as relight does it); told is
    the share of frames that get another word, with its interval, and how many of these words are next to the right one
    on the map.
    """
    from placerec.inspection.word_stability import format_stability, stability as run

    with shared.progress_bar("stability") as progress:
        found = run(sources, words, out, progress=progress, **how)
    shared.echo_json(found.to_json()) if as_json else click.echo(format_stability(found))


@shared.command(epilog="Example: placerec relight RUNS/run3 -o dim/ --light dim")
@shared.source_arguments
@click.option(
    "--light",
    required=True,
    type=click.Choice(["dim", "warm", "lamp", "exposure"]),
    help="A fifth of the light with a sensor's noise; a warm light; a coloured lamp from one side; x 0.45 or x 2.2.",
)
@shared.seed_option("Seed of what is drawn for every sequence, and of the noise.")
@shared.output_option("RELIT/", "The folder to write: a sequence in COLD's layout for every sequence, with its labels.")
@shared.talk_options
def relight(sources: tuple[Path, ...], out: Path, light: str, **how: Any) -> None:
    """Write recordings as they might look in another light (simulated).

    SOURCE is what tokenize takes. What was learned in one light can be tried in others: `placerec decode RELIT/ -m
    MODEL/`, `placerec learn RUNS/ RELIT/`. The formulas are in docs/vision.md.
    """
    from placerec.vision.light import relight as run

    with shared.progress_bar("relight") as progress:
        written = run(sources, out, light, progress=progress, **how)
    shared.log.info("%s: %s", out, counted(written, "frame"))
