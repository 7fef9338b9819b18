"""The demonstration: the synthetic laboratory from images to a page to look at."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from placerec.arrays import Mask
from placerec.errors import check_optional
from placerec.evaluation.metrics import Evaluation, evaluate
from placerec.figures.canvas import figure_file, place_title
from placerec.figures.evaluation import plot_evaluation
from placerec.figures.pages import heading, paragraph, picture, preformatted, table
from placerec.files import whole_folder, write_text
from placerec.frames import Sequence as FrameSequence, find_sequences, read_gray
from placerec.hohmm import Beliefs, write_beliefs
from placerec.inspection.word_sheet import draw_word_sheet
from placerec.inspection.words import WordTable, typical_images, word_sentences, word_table
from placerec.jobs import Progress, ProgressBar
from placerec.lab.layout import render_lab, warn_of_another
from placerec.lm.inspect import format_inspection, inspect_model
from placerec.model import Decoding, ModelOptions, load_recognizer, read_corpus, train_model
from placerec.model.folder import ModelFolder
from placerec.model.learn import learn_folder
from placerec.page.drives import Drive, drives_of
from placerec.page.pictures import pictures_of
from placerec.page.report import Shown, report_page
from placerec.page.tiles import typical_frames
from placerec.vision import (
    DEFAULT_KIND,
    Descriptors,
    DescriptorSpec,
    Dictionary,
    DictionaryOptions,
    DictionarySet,
    DictionarySetOptions,
    describe,
)
from placerec.words import WordStream, read_stream
from placerec.words.folder import write_tokens
from placerec.words.tokenize import tokens_of

SMOOTHINGS = ("witten-bell", "lidstone")
ORDERS = (1, 2)
BEST = ("witten-bell", 2)
# What `placerec learn` makes, beside the paper's systems.
LEARNED = ("learned", 2)
# The paper's protocol: the first two runs of each condition train, the third tests.
TEST_RUN = "3"
OWNED = ("lab", "words.npz", "tokens", "models", "model", "beliefs", "*.png", "report.html")
log = logging.getLogger(__name__)


# Smoothing and order of the models, and how the test sequences were recognised with them.
DemoResults = dict[tuple[str, int], Evaluation]


def run_demo(
    out: Path | str, *, scale: str = "small", seed: int = 0, as_in_paper: bool = False, progress: ProgressBar
) -> DemoResults:
    """`placerec demo`: render the laboratory, learn words and models, recognise the test runs, write the folder `out`.

    Beside the paper's systems, and first, is what `placerec learn` makes, unless all is to be `as_in_paper`.
    `progress(label)` is a context manager that gives a callback(done, total). Returns a result per smoothing and order,
    and one for LEARNED. Raises MissingExtraError without matplotlib, before any work.
    """
    check_optional("matplotlib", "a picture")
    warn_of_another(Path(out) / "lab", scale, seed)
    with whole_folder(Path(out), OWNED) as folder:
        log.info("Rendering the synthetic laboratory (%s, seed %d)", scale, seed)
        with progress("render") as show:
            render_lab(folder / "lab", scale=scale, seed=seed, progress=show)
        sequences = find_sequences([folder / "lab"])
        with progress("describe") as show:
            kind = "gist" if as_in_paper else DEFAULT_KIND
            descriptors = describe(sequences, DescriptorSpec(kind=kind), progress=show)
        log.info("Learning visual words from runs 1 and 2, and translating all runs")
        training = np.array([not name.endswith(TEST_RUN) for name in descriptors.sequences])
        beliefs = {} if as_in_paper else {LEARNED: _learned(folder, descriptors, training, seed)}
        dictionary = _paper_dictionary(folder, descriptors.take(training), seed)
        dictionary.save(folder / "words.npz")
        write_tokens(tokens_of(descriptors, dictionary), DictionarySet.of(dictionary), folder / "tokens")
        log.info("Training language models and recognising run 3")
        beliefs |= {way: _recognise(folder, *way) for way in product(SMOOTHINGS, ORDERS)}
        results = {way: evaluate(found) for way, found in beliefs.items()}
        best = BEST if as_in_paper else LEARNED
        _contact_sheet(_typical_frames(sequences), folder / "laboratory.png")
        words = word_table(descriptors.take(~training), dictionary)
        draw_word_sheet(words, typical_images(words, sequences), folder / "words.png", title="The words of run 3")
        plot_evaluation(beliefs[best], results[best], folder / "beliefs.png")
        log.info("Writing the page")
        drives = _drives(folder, beliefs, best)
        with progress("pictures") as show:
            shown = _shown(folder, drives, sequences, descriptors.take(~training), show)
        page = _report(folder, results, words, len(descriptors.frames), _commands(scale, seed), drives, shown)
        write_text(folder / "report.html", page)
    return results


def _drives(folder: Path, beliefs: Mapping[tuple[str, int], Sequence[Beliefs]], best: tuple[str, int]) -> list[Drive]:
    """The test runs as all systems saw them, the best one first, with what decided every frame in that one."""
    model = folder / "model" if best == LEARNED else folder / "models" / f"{best[0]}-{best[1]}"
    recognizer = load_recognizer(model, options=Decoding(explain=True))
    order = sorted(beliefs, key=lambda way: way != best)
    drives = drives_of({_short_title(way): beliefs[way] for way in order})
    reasons = ([*recognizer.explain_stream(one.stream)] for one in beliefs[best])
    return [replace(drive, decisions={_short_title(best): found}) for drive, found in zip(drives, reasons, strict=True)]


def _shown(
    folder: Path,
    drives: Sequence[Drive],
    sequences: Iterable[FrameSequence],
    descriptors: Descriptors,
    progress: Progress,
) -> Shown:
    """Pictures of all frames, and the typical one of each word."""
    learned = ModelFolder(folder / "model").words
    dictionaries = DictionarySet.load(learned if learned.exists() else folder / "words.npz")
    tests = {sequence.name: sequence for sequence in sequences if sequence.name.endswith(TEST_RUN)}
    return Shown(pictures_of(drives, tests, {}, progress), typical_frames(drives, descriptors, dictionaries))


def _recognise(folder: Path, smoothing: str, order: int) -> list[Beliefs]:
    """Train on runs 1 and 2, and decode run 3, of the tokens in `folder`."""
    files = sorted((folder / "tokens").glob("*.tsv"))
    options = ModelOptions(order=order, smoothing=smoothing)
    corpus = read_corpus([path for path in files if not path.stem.endswith(TEST_RUN)], selection=options.select)
    model = folder / "models" / f"{smoothing}-{order}"
    train_model(corpus.sentences, corpus.vocabulary, model, options=options, record=corpus.record)
    tests = [read_stream(path) for path in files if path.stem.endswith(TEST_RUN)]
    return _decoded(model, tests, folder / "beliefs" / f"{smoothing}-{order}")


def _learned(folder: Path, descriptors: Descriptors, training: Mask, seed: int) -> list[Beliefs]:
    """Learn from runs 1 and 2 as `placerec learn` does, and decode run 3."""
    model = ModelFolder(folder / "model")
    model.path.mkdir()
    train, test = descriptors.take(training), descriptors.take(~training)
    learn_folder(model, train.values, train.table, train.spec, DictionarySetOptions(seed=seed), ModelOptions())
    streams = tokens_of(test, DictionarySet.load(model.words))
    return _decoded(model.path, streams, folder / "beliefs" / LEARNED[0])


def _paper_dictionary(folder: Path, training: Descriptors, seed: int) -> Dictionary:
    """The paper's words: the first of those that `_learned` left in the `folder`, or learned here if there are none."""
    left = ModelFolder(folder / "model").words
    if left.exists():
        return DictionarySet.load(left).dictionaries[0]
    return Dictionary.fit(training.values, spec=training.spec, options=DictionaryOptions(seed=seed))


def _decoded(model: Path, streams: Sequence[WordStream], out: Path) -> list[Beliefs]:
    recognizer = load_recognizer(model)
    beliefs = [recognizer.decode(stream) for stream in streams]
    for found in beliefs:
        write_beliefs(out / f"{found.name}.tsv", found)
    return beliefs


def format_results(results: DemoResults) -> str:
    """The results as a table for the terminal."""
    majority = results[BEST]
    lines = [
        f"Synthetic laboratory, {majority.frames} test frames of {len(majority.sequences)} sequences: frames right",
        f"  {majority.majority_accuracy:6.1%}  always {place_title(majority.majority_place)} (the majority class)",
    ]
    lines += [f"  {found.accuracy:6.1%}  {_title(way)}, n = {way[1]}{_note(way[1])}" for way, found in results.items()]
    return "\n".join(lines)


def _title(way: tuple[str, int]) -> str:
    if way == LEARNED:
        return "eight dictionaries, their weight learned (placerec learn)"
    return f"as in the paper: {way[0]}"


def _short_title(way: tuple[str, int]) -> str:
    return "placerec learn" if way == LEARNED else f"{way[0]}, n = {way[1]}"


def _note(order: int) -> str:
    return " (the classical HMM)" if order == 1 else ""


def _typical_frames(sequences: Sequence[FrameSequence]) -> dict[str, dict[str, Path]]:
    """Illumination -> place -> an image from when the place is entered, from first runs."""
    sheet: dict[str, dict[str, Path]] = {}
    for sequence in sequences:
        if sequence.name.startswith("seq4") and sequence.name.endswith("1"):
            light = sequence.name.removeprefix("seq4_").removesuffix("1")
            for place in sorted({frame.place for frame in sequence.frames}):
                frames = [frame for frame in sequence.frames if frame.place == place]
                sheet.setdefault(light, {})[place] = frames[len(frames) // 10].path
    return sheet


def _contact_sheet(images: Mapping[str, Mapping[str, Path]], path: Path) -> None:
    """Draw the images, row title -> column title -> image file, as one picture.

    Raises MissingExtraError without matplotlib, SourceError for an image that cannot be read.
    """
    columns = sorted({column for row in images.values() for column in row})
    with figure_file(path, 2.1 * len(columns) + 0.3, 1.6 * len(images) + 0.3, "compressed") as figure:
        grid = figure.subplots(len(images), len(columns), squeeze=False)
        for (row, pictures), axes_row in zip(images.items(), grid, strict=True):
            for column, axes in zip(columns, axes_row, strict=True):
                axes.set(xticks=[], yticks=[])
                if column in pictures:
                    axes.imshow(read_gray(pictures[column]), cmap="gray", vmin=0, vmax=255)
            axes_row[0].set_ylabel(row)
        for column, axes in zip(columns, grid[0], strict=True):
            axes.set_title(place_title(column), fontsize=9)


def _report(
    folder: Path,
    results: DemoResults,
    words: WordTable,
    frames: int,
    commands: str,
    drives: Sequence[Drive],
    shown: Shown,
) -> str:
    said = (
        f"A camera was driven through a small office laboratory: {frames} frames in 18 sequences. {_method(results)} A "
        "Bayesian filter followed the belief over places through the six sequences that trained nothing."
    )
    warning = (
        "The laboratory is synthetic, rendered by placerec itself: its results say that the program works, not how "
        "well it does in your rooms. Point at a moment:"
    )
    more = [
        heading("Frames recognised"),
        paragraph(said),
        _results_table(results),
        heading("The synthetic laboratory"),
        picture(
            folder / "laboratory.png",
            "Frames of five places in three illuminations",
            "What the camera sees, by place and light. Synthetic.",
        ),
        heading("The words"),
        paragraph(" ".join(word_sentences(words))),
        picture(
            folder / "words.png",
            "For each of the 100 words a typical frame, framed in the colour of its place",
            "What the words look like in the six synthetic test sequences, as “placerec show-words” draws it.",
        ),
        heading("Everything between is text"),
        paragraph("A token stream, one word per frame (tokens/seq4_cloudy3.tsv):"),
        preformatted(_head(folder / "tokens/seq4_cloudy3.tsv", 8)),
        paragraph("The visits to the kitchen, one a line (models/witten-bell-2/sentences/KT-B.txt):"),
        preformatted(_head(folder / "models/witten-bell-2/sentences/KT-B.txt", 3)),
        paragraph("Its language model, models/witten-bell-2/KT-B.arpa, as “placerec inspect” reads it:"),
        preformatted(_inspected(folder / "models/witten-bell-2", "KT-B")),
        heading("Do it again"),
        preformatted(commands),
    ]
    title = "placerec: which place is the camera in? A synthetic laboratory"
    return report_page(title, drives, shown, intro=[paragraph(warning)], more=more)


def _method(results: DemoResults) -> str:
    if LEARNED not in results:
        return "Every frame became one visual word, every place an n-gram language model of its words."
    return (
        "Every frame became a visual word of each of several dictionaries, every place an n-gram language model for "
        "each of them, and how much all words weigh was learned. The paper's systems have the first dictionary alone, "
        "whose words and models are shown below."
    )


def _results_table(results: DemoResults) -> str:
    majority = results[BEST]
    rows: list[Sequence[object]] = [
        (
            f"always {majority.majority_place} (majority class)",
            None,
            f"{majority.majority_accuracy:.1%}",
            None,
            None,
            None,
        )
    ]
    for way, found in results.items():
        latency = None if found.change_latency_frames is None else f"{found.change_latency_frames:g}"
        name = f"{_title(way)}{_note(way[1])}"
        loss = f"{found.log_loss:.2f}"
        rows.append((name, way[1], f"{found.accuracy:.1%}", f"{found.balanced_accuracy:.1%}", loss, latency))
    return table(
        (
            *("Models", "n", "Frames right", "Mean recall of places", "Log loss"),
            "Frames until right after a change (median)",
        ),
        rows,
        f"{majority.frames} synthetic test frames, the third run of each path and light; runs 1 and 2 trained.",
    )


def _head(path: Path, lines: int) -> str:
    text = path.read_text(encoding="utf-8").splitlines()[:lines]
    return "\n".join(line if len(line) <= 110 else line[:107] + "..." for line in text)


def _inspected(model: Path, place: str) -> str:
    words = (model / f"sentences/{place}.txt").read_text(encoding="utf-8").split()
    after = {second for first, second in pairwise(words) if first == words[0]}
    never = next((word for word in words if word not in after), words[0])
    found = inspect_model(model / f"{place}.arpa", [" ".join(words[:2]), f"{words[0]} {never}"], top=3)
    return format_inspection(found | {"path": f"{place}.arpa"})


def _commands(scale: str, seed: int) -> str:
    return "\n".join(
        [
            f"placerec lab lab/ --scale {scale} --seed {seed}",
            f"placerec train-words lab/seq*[12] --as-in-paper -o words.npz --seed {seed}",
            "placerec show-words words.npz lab/seq*3 -o words.png",
            "placerec tokenize lab/ -w words.npz -o tokens/",
            "placerec train-lm tokens/*[12].tsv --as-in-paper -o model/ --order 2",
            "placerec decode tokens/*3.tsv -m model/ -o beliefs/",
            "placerec evaluate beliefs/*.tsv --plot beliefs.png",
            "",
            f"placerec learn lab/ -o learned/ --seed {seed} $(printf -- '--test %s ' lab/seq*{TEST_RUN})",
        ]
    )
