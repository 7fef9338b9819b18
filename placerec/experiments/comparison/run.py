"""`placerec compare`: every method on the same recordings, at what cost, and whether the difference is real.

OUT/methods.csv             a line per method
OUT/pairs.csv               for every two methods whether their difference holds
OUT/methods.png, .svg       accuracy and cost
OUT/report.html             the test sequences as every method saw them, to point at
OUT/beliefs/METHOD/         the beliefs, one file per test sequence, and run.json: what they were made of
OUT/cache/                  what a second run does not do again: descriptors, words, models
"""

import json
import logging
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from placerec.errors import EvaluationError, SourceError, check_optional
from placerec.evaluation.bootstrap import LEAST
from placerec.experiments.comparison.benchmark import Benchmark, MethodRun, encode, train_models
from placerec.experiments.comparison.figure import plot_comparison
from placerec.experiments.comparison.methods import CHOICES, DEFAULT, SEVERAL_WORDS, TWO_WORDS, method_of
from placerec.experiments.comparison.page import comparison_page
from placerec.experiments.comparison.results import Comparison, format_methods, format_pairs, judge
from placerec.experiments.comparison.views import PLAIN, check_views, see
from placerec.experiments.cost import front_end_cost
from placerec.experiments.several import learn_several
from placerec.experiments.store import Described, WordsJob, describe_all, held_output, keep_given, key_of, load
from placerec.figures.canvas import check_figure
from placerec.files import whole_folder, write_text
from placerec.frames import Sequence as FrameSequence, SourceOptions, find_sequences
from placerec.frames.doubts import warn_of_still_sequences, warn_of_strange_labels, warn_of_training
from placerec.frames.naming import own_name, unique_names
from placerec.hohmm import read_beliefs, write_beliefs
from placerec.jobs import ProgressBar, silent
from placerec.vision import DEFAULT_KIND, DescriptorSpec, Dictionary, DictionaryOptions, DictionarySet
from placerec.vision.options import View

# Of the dictionary that methods use, and of a second one for those that ask for it.
SPEC, SECOND = DescriptorSpec(), DescriptorSpec(kind="centrist")
# The larger of the paper's two maps, with which it recognises rooms better.
SIZE = 20
RUN_JSON = "run.json"
OWNED = ("*.tsv", RUN_JSON)
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Given:
    """What is compared: `every` sequence in the order in which the sources name them, and which of these test.

    `words`: one's own dictionaries, `matrix`: descriptors that were computed elsewhere; None where there are none.
    """

    training: list[FrameSequence]
    tests: list[FrameSequence]
    every: list[FrameSequence]
    words: DictionarySet | None = None
    matrix: Path | None = None


def compare(
    train: Iterable[Path | str],
    test: Iterable[Path | str],
    out: Path | str,
    *,
    methods: Iterable[str] | None = None,
    words: Path | str | None = None,
    network: Path | str | None = None,
    matrix: Path | str | None = None,
    size: int = SIZE,
    seed: int = 0,
    source_options: SourceOptions = SourceOptions(),
    cache: Path | str | None = None,
    progress: ProgressBar = silent,
) -> Comparison:
    """Learn on the sequences of `train` that `test` does not name, run every method on those of `test`, write `out`.

    `methods`: their names; those of descriptors on any view: `knn@lbp:pn`, `rbf-svm-hmm@views-tuned`. `words`: a
    words.npz whose dictionaries `hohmm` uses, all others that of the view `plain` that comes first there; without it
    they are learned from the training sequences, `size` being that of all methods but `hohmm`. `network`: the file of
    the image network, for words of one. `matrix`: a .npy or .npz file of descriptors that were computed elsewhere
    (`vision.external`); the rows of a .npy are those of the sequences as `train` names them, and then of those that
    `test` alone does. `seed`: of dictionaries, prototypes and the bootstrap. What an earlier run into `out` has done on
    the same data is kept; `cache`: the folder for it, by default in `out`. `progress(label)` is a context manager that
    gives a callback(done, total). Raises EvaluationError for an unknown method and for what nothing can be compared on,
    MissingExtraError for what is not installed, VisionError for `words` and a `matrix` that cannot be used, and what
    `find_sequences` raises.
    """
    chosen = check_methods(methods, described=matrix is None)
    for name in chosen:
        if package := method_of(name).package:
            check_optional(package, name, "leave it out of --methods")
    out = Path(out)
    check_figure(out / "methods.png")
    own = None if words is None else _own_words(Path(words), network, described=matrix is None)
    given = replace(_split(train, test, source_options), words=own, matrix=None if matrix is None else Path(matrix))
    _doubt(given)
    cache = out / "cache" if cache is None else Path(cache)
    with held_output(out, cache):
        benchmark = _benchmark(given, chosen, size, seed, cache, progress)
        runs = {}
        with progress("methods") as show:
            for done, name in enumerate(chosen, start=1):
                runs[name] = _method_run(name, benchmark, out / "beliefs" / name)
                show(done, len(chosen))
        found = judge(runs, benchmark.encoded.cost, seed)
        write_text(out / "methods.csv", format_methods(found.scores))
        write_text(out / "pairs.csv", format_pairs(found.pairs))
        for suffix in (".png", ".svg"):
            plot_comparison(found, out / f"methods{suffix}")
        with progress("pictures") as show:
            page = comparison_page(found, runs, given.tests, out / "methods.svg", show)
        write_text(out / "report.html", page)
    _tell(out, found)
    return found


def _own_words(path: Path, network: Path | str | None, described: bool) -> DictionarySet:
    """One's own dictionaries, if methods can use them on descriptors that are computed here (`described`), or not."""
    words = DictionarySet.load(path, network=network)
    if described and words.spec.kind == "npy":
        raise EvaluationError(f"{path}: is of descriptors that were computed elsewhere; --descriptor npy:FILE has them")
    if _plain(words) is None:
        raise EvaluationError(f"{path}: has no dictionary of the view plain, which most methods use; learn one, too")
    return words


def _plain(words: DictionarySet) -> Dictionary | None:
    """The dictionary that methods of one dictionary use."""
    return next((one for one in words.dictionaries if View.parse(one.view).projection == "plain"), None)


def _doubt(given: _Given) -> None:
    labels = [[frame.place for frame in sequence.frames] for sequence in given.tests]
    warn_of_still_sequences(labels)
    warn_of_strange_labels(labels, sorted({frame.place for one in given.training for frame in one.frames} - {""}))
    if given.words is not None:
        warn_of_training([one.name for one in given.tests if one.name in given.words.sequences], "words")


def _benchmark(
    given: _Given, methods: Sequence[str], size: int, seed: int, cache: Path, progress: ProgressBar
) -> Benchmark:
    """What the methods are run on: descriptors, words and models."""

    def described(spec: DescriptorSpec) -> list[Described]:
        with progress(f"describe ({spec.kind})") as show:
            return describe_all(given.every, spec, cache, progress=show)

    def job(every: list[Described]) -> WordsJob:
        of = {one.sequence.name: one for one in every}
        training, tests = (tuple(of[one.name] for one in part) for part in (given.training, given.tests))
        return WordsJob(training, tests, DictionaryOptions(size=size, seed=seed), cache)

    dictionary = _plain(given.words) if given.words else None
    spec = dictionary.spec if dictionary else None
    asked = [method_of(name) for name in methods]
    kinds, views = {one.kind for one in asked}, dict.fromkeys(one.view for one in asked)
    if given.matrix is not None:
        whole = first = job(keep_given(given.every, spec, given.matrix, cache))
        check_views(views, whole.train[0].spec)
    else:
        # What several dictionaries see of a frame holds what the other methods do.
        every = given.words.spec if given.words else DescriptorSpec(kind=DEFAULT_KIND)
        check_views(views, every)
        whole = job(described(every))
        first = whole.part(spec or SPEC)
    learned = {one.kept for one in first.train}
    warn_of_training([one.sequence.name for one in first.test if one.kept in learned], "words and the models")
    encoded = encode(first, dictionary or first.dictionary())
    seen = see(views, whole, encoded.dictionary, given.words)
    second = None
    if TWO_WORDS in kinds:
        other = job(described(SECOND))
        second = encode(other, other.dictionary())
    several, cost = None, None
    if SEVERAL_WORDS in kinds:
        several = learn_several(whole, seed, given.words)
        cost = front_end_cost(whole, [one.load() for one in whole.test], several.dictionaries)
    training = len(given.training)
    return Benchmark(encoded, training, train_models(encoded, training, cache), seed, seen, second, several, cost)


def check_methods(methods: Iterable[str] | None = None, *, described: bool = True) -> list[str]:
    """The names of methods in the order of the table, then others; DEFAULT for None.

    Raises EvaluationError for an unknown name and for none. Unless frames are `described` here, no method can ask for a
    second descriptor.
    """
    kinds = {name: method_of(name).kind for name in (DEFAULT if methods is None else methods)}
    asking = [name for name, kind in kinds.items() if kind == TWO_WORDS and not described]
    if methods is None:
        return [name for name in kinds if name not in asking]
    if not kinds:
        raise EvaluationError(f"no method is named; {CHOICES}")
    if asking:
        raise EvaluationError(
            f"{asking[0]} describes images itself, and the descriptors come from elsewhere; leave it out"
        )
    return sorted(kinds, key=lambda name: DEFAULT.index(name) if name in DEFAULT else len(DEFAULT))


def _split(train: Iterable[Path | str], test: Iterable[Path | str], source_options: SourceOptions) -> _Given:
    """The sequences to learn from and to test on, under names that are unique among both."""
    testing = find_sequences(test, options=source_options)
    left_out = {sequence.source.resolve() for sequence in testing}
    named = find_sequences(train, options=source_options)
    learning = [s for s in named if s.source.resolve() not in left_out]
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
    order = {sequence.source.resolve(): number for number, sequence in reversed([*enumerate([*named, *testing])])}
    return _Given(training, tests, sorted(both, key=lambda one: order[one.source.resolve()]))


def _method_run(name: str, benchmark: Benchmark, folder: Path) -> MethodRun:
    """The run in `folder` if it is one on the same data, or else a new one, which is left there."""
    method = method_of(name)
    more: list[object] = [] if method.view == PLAIN else [*benchmark.views[method.view].points]
    if benchmark.second and method.kind == TWO_WORDS:
        more = [benchmark.second.dictionary.fingerprint]
    if benchmark.several and method.kind == SEVERAL_WORDS:
        more = [benchmark.several.models.folder.path.name]
    key = key_of(name, benchmark.key, *more)
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
    describing = "" if math.isnan(found.cost.descriptor) else f"{found.cost.descriptor / 1000:.1f} ms to describe and "
    what = f"{describing}{found.cost.word:.0f} us to find its word, reading not counted"
    log.info("before every method a frame takes %s", what)
    for score in found.scores:
        if score.consulted is not None:
            log.info("%s asked its second dictionary for %.0f %% of the frames", score.method, 100 * score.consulted)
