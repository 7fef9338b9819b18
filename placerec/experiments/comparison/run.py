"""`placerec compare`: every method on the same recordings, at what cost, and whether the difference is real.

OUT/methods.csv             a line per method
OUT/pairs.csv               for every two methods whether their difference holds
OUT/methods.png, .svg       accuracy and cost
OUT/beliefs/METHOD/         the beliefs, one file per test sequence, and run.json: what they were made of
OUT/cache/                  what a second run does not do again: descriptors, words, models
"""

import json
import logging
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from placerec.errors import EvaluationError, SourceError, check_optional
from placerec.evaluation.bootstrap import LEAST
from placerec.experiments.comparison.benchmark import (
    COMPARED,
    SEVERAL_WORDS,
    TWO_WORDS,
    Benchmark,
    EncodedSequences,
    MethodRun,
    encode,
    train_models,
)
from placerec.experiments.comparison.figure import plot_comparison
from placerec.experiments.comparison.results import Comparison, format_methods, format_pairs, judge
from placerec.experiments.comparison.several import learn_several
from placerec.experiments.store import WordsJob, describe_all, held_output, key_of, load
from placerec.figures.canvas import check_figure
from placerec.files import whole_folder, write_text
from placerec.frames import Sequence as FrameSequence, SourceOptions, find_sequences
from placerec.frames.doubts import warn_of_still_sequences, warn_of_strange_labels, warn_of_training
from placerec.frames.naming import own_name, unique_names
from placerec.hohmm import read_beliefs, write_beliefs
from placerec.jobs import ProgressBar, silent
from placerec.vision import DescriptorSpec, DictionaryOptions

# Of the dictionary that methods use, and of a second one for those that ask for it.
SPECS = (DescriptorSpec(), DescriptorSpec(kind="centrist"))
# The larger of the paper's two maps, with which it recognises rooms better.
SIZE = 20
RUN_JSON = "run.json"
OWNED = ("*.tsv", RUN_JSON)
log = logging.getLogger(__name__)


def compare(
    train: Iterable[Path | str],
    test: Iterable[Path | str],
    out: Path | str,
    *,
    methods: Iterable[str] | None = None,
    size: int = SIZE,
    seed: int = 0,
    source_options: SourceOptions = SourceOptions(),
    cache: Path | str | None = None,
    progress: ProgressBar = silent,
) -> Comparison:
    """Learn on the sequences of `train` that `test` does not name, run every method on those of `test`, write `out`.

    `size`, `seed`: of the dictionaries; the seed also draws prototypes and the bootstrap. What an earlier run into
    `out` has done on the same data is kept; `cache`: the folder for it, by default in `out`. `progress(label)` is a
    context manager that gives a callback(done, total). Raises EvaluationError for an unknown method and for sequences
    that nothing can be compared on, MissingExtraError for what is not installed, and what `find_sequences` raises.
    """
    chosen = check_methods(methods)
    for name in chosen:
        if package := COMPARED[name].package:
            check_optional(package, name, "leave it out of --methods")
    out = Path(out)
    check_figure(out / "methods.png")
    training, tests = _split(train, test, source_options)
    labels = [[frame.place for frame in sequence.frames] for sequence in tests]
    warn_of_still_sequences(labels)
    warn_of_strange_labels(labels, sorted({frame.place for one in training for frame in one.frames} - {""}))
    cache = out / "cache" if cache is None else Path(cache)
    with held_output(out, cache):
        encoded: list[EncodedSequences] = []
        jobs: list[WordsJob] = []
        for spec in SPECS[: 1 + any(COMPARED[name].kind == TWO_WORDS for name in chosen)]:
            with progress(f"describe ({spec.kind})") as show:
                described = describe_all([*training, *tests], spec, cache, progress=show)
                both = tuple(described[: len(training)]), tuple(described[len(training) :])
                if not encoded:
                    learned = {one.kept for one in both[0]}
                    warn_of_training(
                        [one.sequence.name for one in both[1] if one.kept in learned], "words and the models"
                    )
                job = WordsJob(*both, DictionaryOptions(size=size, seed=seed), cache)
                encoded.append(encode(job, () if encoded else {COMPARED[name].view for name in chosen}))
                jobs.append(job)
        several = None
        if any(COMPARED[name].kind == SEVERAL_WORDS for name in chosen):
            several = learn_several(jobs[0], seed)
        models = train_models(encoded[0], len(training), cache)
        second = encoded[1] if len(encoded) > 1 else None
        benchmark = Benchmark(encoded[0], len(training), models, seed, second, several)
        runs = {}
        with progress("methods") as show:
            for done, name in enumerate(chosen, start=1):
                runs[name] = _method_run(name, benchmark, out / "beliefs" / name)
                show(done, len(chosen))
        found = judge(runs, encoded[0].cost, seed)
        write_text(out / "methods.csv", format_methods(found.scores))
        write_text(out / "pairs.csv", format_pairs(found.pairs))
        for suffix in (".png", ".svg"):
            plot_comparison(found, out / f"methods{suffix}")
    _tell(out, found)
    return found


def check_methods(methods: Iterable[str] | None = None) -> list[str]:
    """The methods in the order of the table, all of them for None; EvaluationError for an unknown one or none."""
    names = set(COMPARED if methods is None else methods)
    choice = f"choose from {', '.join(COMPARED)}"
    if unknown := sorted(names.difference(COMPARED)):
        raise EvaluationError(f"no method is called {unknown[0]!r}; {choice}")
    if not names:
        raise EvaluationError(f"no method is named; {choice}")
    return [name for name in COMPARED if name in names]


def _split(
    train: Iterable[Path | str], test: Iterable[Path | str], source_options: SourceOptions
) -> tuple[list[FrameSequence], list[FrameSequence]]:
    """The sequences to learn from and to test on, under names that are unique among both."""
    testing = find_sequences(test, options=source_options)
    left_out = {sequence.source.resolve() for sequence in testing}
    learning = [s for s in find_sequences(train, options=source_options) if s.source.resolve() not in left_out]
    if not learning:
        raise EvaluationError("every sequence is a test sequence, and none is left to learn from; name others")
    both = [*learning, *testing]
    if (
        source_options.labels
        and source_options.labels.is_file()
        and sum(sequence.recording is not None for sequence in both) > 1
    ):
        what = "is one file, and training and test are several recordings"
        raise SourceError(f"{source_options.labels}: {what}; name a folder that holds NAME.labels for each")
    names = unique_names([(own_name(s.source.resolve()), s.source) for s in both], SourceError)
    both = [replace(sequence, name=name) for sequence, name in zip(both, names, strict=True)]
    training, tests = both[: len(learning)], both[len(learning) :]
    places = {frame.place for sequence in training for frame in sequence.frames} - {""}
    if len(places) < 2:
        raise EvaluationError(
            f"the training sequences name {len(places)} places; label two at least to compare methods"
        )
    if not any(frame.place for sequence in tests for frame in sequence.frames):
        raise EvaluationError(f"no frame of {tests[0].source} has a label, so nothing can be judged; label the tests")
    return training, tests


def _method_run(name: str, benchmark: Benchmark, folder: Path) -> MethodRun:
    """The run in `folder` if it is one on the same data, or else a new one, which is left there."""
    method = COMPARED[name]
    more = ""
    if benchmark.second and method.kind == TWO_WORDS:
        more = benchmark.second.dictionary.fingerprint
    if benchmark.several and method.kind == SEVERAL_WORDS:
        more = benchmark.several.models.folder.path.name
    key = key_of(name, benchmark.key, more)
    known = load(folder / RUN_JSON)
    if known.get("key") == key:
        log.info("%s: as the run before left it", name)
        beliefs = [read_beliefs(folder / f"{benchmark.encoded.streams[i].name}.tsv") for i in benchmark.tests]
        return MethodRun(beliefs, known["microseconds_per_frame"], known["consulted"])
    run = method.run(benchmark)
    with whole_folder(folder, OWNED) as partial:
        for beliefs_of_one in run.beliefs:
            write_beliefs(partial / f"{beliefs_of_one.name}.tsv", beliefs_of_one)
        facts = {"key": key, "method": name, "microseconds_per_frame": run.microseconds, "consulted": run.consulted}
        write_text(partial / RUN_JSON, json.dumps(facts, indent=2) + "\n")
    return run


def _tell(out: Path, found: Comparison) -> None:
    number, what = found.drawn
    if what == "visits":
        log.warning(
            "one labelled test sequence: the intervals are over its %d visits, and say nothing of another recording",
            number,
        )
    else:
        log.info("%s: %d methods; intervals over %d test sequences", out, len(found.scores), number)
    if number < LEAST:
        log.warning("no difference between methods can hold with fewer than %d test %s", LEAST, what)
    log.info(
        "before every method a frame takes %.1f ms to describe and %.0f us to find its word, reading not counted",
        found.cost.descriptor / 1000,
        found.cost.word,
    )
    for score in found.scores:
        if score.consulted is not None:
            log.info("%s asked its second dictionary for %.0f %% of the frames", score.method, 100 * score.consulted)
