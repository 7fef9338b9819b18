"""`placerec report`: beliefs as one file that opens from disk and is pointed at.

The file needs no network and no second file: the drives and their beliefs are in it as JSON, frames as small pictures,
and the scripts of placerec/page/static/ as one.
"""

import html
import logging
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from placerec.errors import MissingExtraError, counted
from placerec.evaluation.metrics import Evaluation, evaluate, place_order
from placerec.evaluation.summary import percent
from placerec.figures.canvas import place_title
from placerec.figures.evaluation import plot_evaluation, read_files
from placerec.figures.pages import html_page, paragraph, picture, table
from placerec.files import write_text
from placerec.frames import Sequence as FrameSequence, SourceOptions, find_sequences
from placerec.hohmm.beliefs import Beliefs
from placerec.hohmm.explain import EXPLAINED
from placerec.inspection.decision import read_decisions
from placerec.jobs import Progress, ProgressBar, silent
from placerec.page import assets
from placerec.page.drives import Drive, group_files, json_in_page, pack_drive
from placerec.page.pictures import pictures_of, sequences_of
from placerec.page.tiles import tiles_of

log = logging.getLogger(__name__)

# Of a drive the numbers of the frames that are shown, ascending, and their pictures.
Pictures = tuple[list[int], list[str]]


@dataclass(frozen=True)
class Shown:
    """What a report shows beside beliefs: pictures by drive, and the typical frame of each word: drive and frame."""

    pictures: Mapping[str, Pictures] = field(default_factory=dict)
    tiles: Mapping[str, tuple[str, int]] = field(default_factory=dict)


NOTHING = Shown()


def report(
    beliefs: Iterable[Path | str],
    out: Path | str,
    *,
    frames: Iterable[Path | str] = (),
    words: Path | str | None = None,
    network: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    cache: Path | str | None = None,
    progress: ProgressBar = silent,
) -> list[Drive]:
    """Write a page of some beliefs files, or folders of them, to the file `out`; returns its drives.

    Files of one name and the same frames are one drive, seen by several systems, which the page shows beside each
    other. What `decode --explain` wrote beside a file is taken in. `frames`: image sources (`source_options`) whose
    frames are shown; `words`: the words.npz, for the typical frame of each word among these, `network`: the file of the
    image network, for words of one, and `cache`: see `placerec.vision.describe`. Raises EvaluationError, SourceError
    and VisionError for what cannot be read or does not belong together.
    """
    named = read_files(beliefs)
    explained = {path: path.with_name(one.name + EXPLAINED) for path, one in named}
    decisions = {path: list(read_decisions(of)) for path, of in explained.items() if of.is_file()}
    drives = group_files(named, decisions)
    shown = NOTHING
    if sources := list(frames):
        sequences = sequences_of(drives, find_sequences(sources, options=source_options))
        with progress("describe") as show:
            tiles = tiles_of(drives, sequences, words, show, cache, network) if words else {}
        with progress("pictures") as show:
            pictures = pictures_of(drives, sequences, wanted_frames(drives, tiles), show)
        shown = Shown(pictures, tiles)
        for drive in drives:
            if drive.name not in sequences:
                log.warning("%s: no source has its frames; it is shown without pictures", drive.name)
    title = drives[0].name if len(drives) == 1 else f"{len(drives)} drives"
    write_text(Path(out), report_page(f"placerec report: {title}", drives, shown, more=systems_table(drives)))
    return drives


def report_page(
    title: str, drives: Sequence[Drive], shown: Shown = NOTHING, *, intro: Sequence[str] = (), more: Sequence[str] = ()
) -> str:
    """The HTML of a report: the headline, `intro`, the drives to point at, their still picture, and `more` below.

    `intro` and `more` are pieces of HTML from `placerec.figures.pages`.
    """
    judged = judge(drives)
    body = [*headline(drives, judged), *intro, explorer(drives, shown), *_still(drives, judged), *more]
    return page_with_explorer(title, body)


def page_with_explorer(title: str, body: Iterable[str]) -> str:
    """The HTML of a page that holds one `explorer` among the pieces of its `body`."""
    style = assets.text("page.css") + assets.text("report.css")
    return html_page(title, body, style=style, script=assets.in_one("report.js"))


def judge(drives: Sequence[Drive]) -> dict[str, Evaluation]:
    """The evaluation of each system, of those that decoded a labelled frame."""
    of_system: dict[str, list[Beliefs]] = {}
    for drive in drives:
        for name, beliefs in drive.beliefs.items():
            of_system.setdefault(name, []).append(beliefs)
    return {name: evaluate(found) for name, found in of_system.items() if any(any(one.truth) for one in found)}


def headline(drives: Sequence[Drive], judged: Mapping[str, Evaluation]) -> list[str]:
    """The one number first, of the first system, and what it is to be read against."""
    frames = sum(len(drive.frames) for drive in drives)
    what = f"{counted(frames, 'frame')} of {counted(len(drives), 'drive')}"
    if not judged:
        return [paragraph(f"{what}; none has a label, so that nothing can be said of what is right.")]
    name, first = next(iter(judged.items()))
    by = f" by {name}" if len(judged) > 1 else ""
    always = f"always {place_title(first.majority_place)}"
    sentence = html.escape(f" of {first.frames} labelled frames right{by}; {always} would be ")
    numbers = [f"balanced accuracy {percent(first.balanced_accuracy)}", f"ECE {first.ece:.3f}"]
    if first.change_latency_frames is not None:
        numbers.append(f"a new place noticed after {counted(first.change_latency_frames, 'frame')} (median)")
    if first.unlabelled:
        numbers.append(f"{counted(first.unlabelled, 'frame')} without a label left out")
    told = f"<strong>{percent(first.accuracy)}</strong>{sentence}{percent(first.majority_accuracy)}."
    below = html.escape(", ".join([what, *numbers]))
    return [f'<p class="headline">{told}</p>', f'<p class="soft">{below}.</p>']


def systems_table(drives: Sequence[Drive]) -> list[str]:
    """A line per system, if there are several."""
    rows = [
        (name, percent(one.accuracy), percent(one.balanced_accuracy), f"{one.ece:.3f}", f"{one.log_loss:.2f}")
        for name, one in judge(drives).items()
    ]
    head = ("beliefs", "frames right", "mean recall of places", "ECE", "log loss")
    return [table(head, rows, "All beliefs of this page.")] if len(rows) > 1 else []


def explorer(drives: Sequence[Drive], shown: Shown) -> str:
    """What is pointed at: an empty element that the script fills, and the data of it."""
    systems = list(dict.fromkeys(name for drive in drives for name in drive.beliefs))
    places = place_order([beliefs for drive in drives for beliefs in drive.beliefs.values()])
    number = {drive.name: index for index, drive in enumerate(drives)}
    packed = [pack_drive(one, places, systems) | {"pictures": shown.pictures.get(one.name)} for one in drives]
    data = {
        "places": places,
        "titles": [place_title(place) for place in places],
        "systems": systems,
        "tiles": {word: (number[drive], frame) for word, (drive, frame) in shown.tiles.items()},
        "drives": packed,
    }
    needs = "This part of the page needs JavaScript, which the browser does not run here; print it for still pictures."
    return (
        f'<main id="report"><p class="soft">{needs}</p></main>\n'
        f'<script type="application/json" id="data">{json_in_page(data)}</script>'
    )


def _still(drives: Sequence[Drive], judged: Mapping[str, Evaluation]) -> list[str]:
    """The picture of `evaluate --plot`, of the first system, for paper; nothing without matplotlib or labels."""
    if not judged:
        return []
    name, evaluation = next(iter(judged.items()))
    beliefs = [drive.beliefs[name] for drive in drives if name in drive.beliefs]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "beliefs.svg"
        try:
            plot_evaluation(beliefs, evaluation, path)
        except MissingExtraError:
            return []
        drawn = picture(path, "Belief over time, confusion matrix, calibration", name)
    return [f'<div class="still">{drawn}</div>']


def shown_of(drives: Sequence[Drive], sequences: Mapping[str, FrameSequence], progress: Progress | None) -> Shown:
    """The pictures of drives whose images are those of `sequences`, by the drives' names."""
    return Shown(pictures_of(drives, sequences, wanted_frames(drives, {}), progress))


def wanted_frames(drives: Sequence[Drive], tiles: Mapping[str, tuple[str, int]]) -> dict[str, list[int]]:
    """The frames whose pictures a report should have before others: wrong ones, changes of place, typical of a word."""
    wanted: dict[str, list[int]] = {drive.name: [] for drive in drives}
    for name, frame in tiles.values():
        wanted[name].append(frame)
    for drive in drives:
        columns = [drive.truth, *(beliefs.best for beliefs in drive.beliefs.values())]
        for frame in range(len(drive.frames)):
            changed = frame > 0 and any(column[frame] != column[frame - 1] for column in columns)
            if changed or (drive.truth[frame] and any(best[frame] != drive.truth[frame] for best in columns[1:])):
                wanted[drive.name].append(frame)
    return wanted
