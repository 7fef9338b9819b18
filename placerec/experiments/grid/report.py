"""The report of an experiment: figure, tables and claims as files, and one page that shows all of it."""

import platform
import shlex
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from os.path import relpath
from pathlib import Path

import numpy as np

from placerec.errors import ExperimentError
from placerec.evaluation.bootstrap import DRAWS, LEAST
from placerec.evaluation.metrics import evaluate
from placerec.experiments.grid.cells import GridCell, GridJob, believe_cell
from placerec.experiments.grid.claims import CANNOT_TELL, FAILS, HIGH, HOLDS, NOT_TRIED, Claim, Statement, judge
from placerec.experiments.grid.config import Config
from placerec.experiments.grid.figure import draw_confusion, draw_figure, draw_strips
from placerec.experiments.grid.results import LEARNED_CSV, LearnedRow, Results, Row, Setting, by_seed
from placerec.experiments.grid.splits import LIGHT
from placerec.experiments.store import key_of, load, save
from placerec.figures.pages import Mark, heading, paragraph, picture, preformatted, table
from placerec.files import content_digest_of_file, read_text, write_text
from placerec.hohmm import Beliefs
from placerec.inspection.word_sheet import draw_word_sheet
from placerec.inspection.words import typical_images, word_table
from placerec.page.drives import drives_of
from placerec.page.report import explorer, page_with_explorer, shown_of
from placerec.version import __version__
from placerec.vision import Descriptors, Dictionary

PAPER_RUNS = {10: "3.15", 20: "2.67"}
_CAPTION = (
    "Mean over seeds, with one standard deviation. Dotted: always the most frequent place. Dashed: naive Bayes. "
    "Dash-dotted, if it is there: placerec learn, whose dictionaries and weights are not the paper's."
)
SIMULATED = "Tests are frames in simulated light, as placerec relight makes it; training frames are as they are."
_PACKAGES = ("numpy", "scipy", "opencv-python-headless", "matplotlib")
_MARKS: Mapping[str, Mark] = {HOLDS: "yes", FAILS: "no", CANNOT_TELL: "open", NOT_TRIED: "none"}
Table = tuple[Sequence[str], Sequence[Sequence[str]]]


def images_table(folds: Mapping[str, Mapping[str, Mapping[str, int]]]) -> Table:
    """Labelled images per place and split (the paper's Table 2)."""
    places = sorted({place for fold in folds.values() for images in fold.values() for place in images})
    lines = []
    for name, fold in folds.items():
        for split, images in fold.items():
            counts = [images.get(place, 0) for place in places]
            lines.append((name, f"{split}ing", *map(str, counts), str(sum(counts))))
    return ("fold", "split", *places, "all"), lines


def runs_table(rows: Iterable[Row]) -> Table:
    """Frames in a row with the same word in training, mean over seeds and folds (the paper's Table 1)."""
    runs: dict[int, dict[tuple[int, str], float]] = {}
    for row in rows:
        runs.setdefault(row.size, {})[row.seed, row.fold] = row.same_word_run
    lines = [
        (str(size), f"{np.mean([*values.values()]):.2f}", PAPER_RUNS.get(size, ""))
        for size, values in sorted(runs.items())
    ]
    return ("S", "same-word run", "in the paper, on COLD"), lines


def best_table(results: Results, most: int = 10) -> Table:
    """The best settings, with baselines: percent of the frames, mean and standard deviation over seeds.

    Before them, if it was run, what `placerec learn` makes.
    """
    tables = [
        by_seed(results.rows, share) for share in (lambda o: o.right, lambda o: o.frame_wise, lambda o: o.majority)
    ]
    lines: list[Sequence[str]] = []
    if learned := results.learned_by_seed():
        lines.append(("several", "placerec learn", "none", "2", "learned", _percent(learned), "", ""))
    for setting in ranked(results)[:most]:
        right, alone, majority = (table[setting] for table in tables)
        names = str(setting.size), setting.smoothing, setting.select, str(setting.order), setting.transition
        lines.append((*names, _percent(right), f"{100 * np.mean(alone):.1f}", f"{100 * np.mean(majority):.1f}"))
    names_ = ("S", "smoothing", "select", "n", "transition")
    return (*names_, "frames right, %", "each frame alone, %", "most frequent place, %"), lines


def light_table(results: Results, lights: Mapping[str, str]) -> Table:
    """A line per simulated light, given that of each fold: percent right (mean over seeds) and log loss.

    Of the best setting, and of what `placerec learn` makes if it was run.
    """
    best, lines = ranked(results)[0], []
    for light in dict.fromkeys(lights.values()):
        own = [row for row in results.rows if row.setting == best and lights[row.fold] == light]
        learned = [row for row in results.learned if lights[row.fold] == light]
        cells = [_percent(by_seed(own)[best]), _log_loss(own)]
        if learned:
            cells += [_percent(replace(results, learned=learned).learned_by_seed()), _log_loss(learned)]
        lines.append((light, *cells))
    learned_columns = ("placerec learn: frames right, %", "log loss") if results.learned else ()
    return ("simulated light", "best of the grid: frames right, %", "log loss", *learned_columns), lines


def _log_loss(rows: Sequence[Row | LearnedRow]) -> str:
    return f"{np.average([row.log_loss for row in rows], weights=[row.frames for row in rows]):.3f}"


def _percent(seeds: Sequence[float]) -> str:
    spread = f" ± {100 * np.std(seeds, ddof=1):.1f}" if len(seeds) > 1 else ""
    return f"{100 * np.mean(seeds):.1f}{spread}"


def ranked(results: Results) -> list[Setting]:
    """All settings, the best first by the mean over seeds; of equals the first in order."""
    accuracy = by_seed(results.rows)
    return sorted(accuracy, key=lambda setting: (-np.mean(accuracy[setting]), setting))


def verdicts_table(claims: Mapping[str, Sequence[Claim]]) -> Table:
    """A line per claim, and its verdict for each kind of transitions."""
    same = zip(*claims.values(), strict=True)
    lines = [(judged[0].name, judged[0].text, *(claim.verdict for claim in judged)) for judged in same]
    return ("claim", "the paper says", *(f"{transition} transitions" for transition in claims)), lines


def claims_table(claims: Sequence[Claim]) -> Table:
    """A line per statement."""
    lines = [
        ("" if number else claim.name, statement.text, *numbers_of(statement), statement.verdict)
        for claim in claims
        for number, statement in enumerate(claim.statements)
    ]
    return ("claim", "measured", "points", "95 %", "wanted", "this number"), lines


def numbers_of(statement: Statement) -> tuple[str, str, str]:
    """The number, its interval or why there is none, and what was wanted."""
    found = statement.interval
    number = "" if statement.values is None else f"{statement.values[0]:+.1f}"
    return number, f"{found[0]:+.1f} to {found[1]:+.1f}" if found else statement.reason, statement.wanted


def reading(sequences: int, seeds: int) -> str:
    """How the verdicts are to be read."""
    return (
        f"Points are percent of the test frames, mean over {seeds} seeds. The interval is the middle 95 % of {DRAWS} "
        f"draws of the {sequences} test sequences with replacement, the same draws on both sides of a difference; it "
        "does not cover what other training sequences would change. A number holds if its whole interval is where it "
        "is wanted, does not hold if the whole interval is elsewhere, and otherwise cannot be told. A claim holds if "
        f"all its numbers hold, and is not in the grid if none of them can be computed from it. Fewer than {LEAST} "
        "test sequences tell nothing: by chance all may be on one side. A "
        "best or worst cell is chosen on all sequences, so its number flatters. What several percent (2), little (2), "
        f"among the best (1) and high ({HIGH:g} %) mean was set by placerec, not by the paper."
    )


def markdown(table: Table) -> str:
    """A table as Markdown."""
    header, lines = table
    rows = [header, ["---"] * len(header), *lines]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n" for row in rows)


def format_tables(results: Results, lights: Mapping[str, str]) -> str:
    """The text of tables.md; `lights`: the simulated light of each fold's tests, where they are not as they are."""
    parts = [
        "# Tables\n",
        "## Labelled images per place and split\n",
        markdown(images_table(results.folds)),
        "## Frames in a row with the same word\n",
        "Training sequences, mean over seeds and folds, cut at the ends of sequences.\n",
        markdown(runs_table(results.rows)),
        "## The best of the grid\n",
        markdown(best_table(results)),
    ]
    if lights:
        parts += ["## In each light\n", f"{SIMULATED}\n", markdown(light_table(results, lights))]
    return "\n".join(parts)


def format_claims(claims: Mapping[str, Sequence[Claim]], note: str) -> str:
    """The text of claims.md; `claims` by transition."""
    parts = ["# The paper's claims\n", markdown(verdicts_table(claims)), note + "\n"]
    for transition, judged in claims.items():
        parts += [f"## With {transition} transitions\n", markdown(claims_table(judged))]
    return "\n".join(parts)


def write_reports(results: Results, plan: Config, config: Path, jobs: Sequence[GridJob], out: Path) -> None:
    """Write figure.png and figure.svg, tables.md, claims.md and report.html into `out`, unless they are there already.

    With more than one kind of transitions the first of the config has the figure, others figure-NAME. Raises
    MissingExtraError without matplotlib.
    """
    record, key = out / "cache" / "report.json", _key(config, jobs, out)
    if load(record) != {"key": key, "files": _contents(out)}:
        _write(results, plan, config, jobs, out)
        save(record, {"key": key, "files": _contents(out)})


def _key(config: Path, jobs: Sequence[GridJob], out: Path) -> str:
    """A digest of all that the report depends on."""
    names = [name for name in ("results.csv", "sequences.csv", LEARNED_CSV) if (out / name).exists()]
    rows = [content_digest_of_file(out / name, ExperimentError) for name in names]
    made_of = [(job.work.kept.name, job.images.folder.name if job.images else "") for job in jobs]
    return key_of("report", rows, made_of, str(config), read_text(config, ExperimentError), str(out), _versions())


def _contents(out: Path) -> dict[str, str]:
    paths = sorted(path for pattern in ("*.md", "*.html", "figure*") for path in out.glob(pattern))
    return {path.name: content_digest_of_file(path, ExperimentError) for path in paths}


def _write(results: Results, plan: Config, config: Path, jobs: Sequence[GridJob], out: Path) -> None:
    lights = {job.fold.name: job.fold.light for job in jobs if job.fold.light}
    note = reading(len({name for row in results.rows for name in row.sequences}), plan.seeds)
    note += f" {SIMULATED}" * bool(lights)
    claims = {transition: judge(results, transition) for transition in plan.transition}
    write_text(out / "tables.md", format_tables(results, lights))
    write_text(out / "claims.md", format_claims(claims, note))
    best = ranked(results)[0]
    body = [
        paragraph(_what(results, plan, config)),
        heading("Frames right"),
        *_figures(results, plan, out),
        table(*best_table(results), _best_caption(results)),
        *([table(*light_table(results, lights), SIMULATED)] if lights else []),
        heading("The paper's claims"),
        table(*verdicts_table(claims), "Verdicts; the numbers are below.", marks=_MARKS),
        paragraph(note),
        *(table(*claims_table(claims[name]), f"With {name} transitions.", marks=_MARKS) for name in claims),
        heading("The data"),
        table(*images_table(results.folds), "Labelled images per place and split."),
        table(*runs_table(results.rows), "Frames in a row with the same word, in training."),
        *_closer_look(results, jobs),
        heading("Do it again"),
        preformatted(f"placerec experiment {shlex.quote(config.name)} -o {shlex.quote(out.resolve().name)}/"),
        paragraph(f"{config.name}:"),
        preformatted(read_text(config, ExperimentError)),
        paragraph(f"The best way of the grid, step by step ({best}; seed 0):"),
        preformatted(commands_of(plan, best, _of(jobs, best)[0])),
        *_learning(plan, results, jobs[0]),
        preformatted(_versions()),
    ]
    write_text(out / "report.html", page_with_explorer(f"placerec experiment: {config.stem}", body))


def _best_caption(results: Results) -> str:
    caption = "The ten best of the grid, with what is right without any filter."
    return f"What placerec learn makes of the same images, and t{caption[1:]}" if results.learned else caption


def _learning(plan: Config, results: Results, job: GridJob) -> Iterator[str]:
    """How the system of `placerec learn` is run on the fold of a job."""
    if results.learned and job.images is not None:
        yield paragraph("The system of placerec learn (seed 0):")
        sources = [[_from(plan, one.sequence.source) for one in part] for part in (job.images.train, job.images.test)]
        tests = " ".join(f"--test {shlex.quote(test)}" for test in sources[1])
        yield preformatted(f"placerec learn {_listed(sources[0])} -o learned/ --seed {job.seed} {tests}")


def _figures(results: Results, plan: Config, out: Path) -> Iterator[str]:
    """Draw the paper's figure for each kind of transitions, as PNG and SVG."""
    for old in out.glob("figure-*"):
        old.unlink()
    for number, transition in enumerate(plan.transition):
        rows = [row for row in results.rows if row.transition == transition]
        title = f"{transition} transitions" + ", simulated light" * (plan.split == LIGHT)
        path = out / f"figure{f'-{transition}' if number else ''}.svg"
        draw = partial(draw_figure, rows, plan, title=title, learned=results.learned_by_seed())
        draw(path)
        draw(path.with_suffix(".png"))
        with tempfile.TemporaryDirectory() as folder:
            narrow = Path(folder) / "narrow.png"
            draw(narrow, narrow=True)
            yield picture(path.with_suffix(".png"), f"Accuracy by n, {title}", _CAPTION, narrow=narrow)


def _what(results: Results, plan: Config, config: Path) -> str:
    frames = {name: sum(fold["test"].values()) for name, fold in results.folds.items()}
    source = f"the token streams {plan.tokens}" if plan.tokens else f"the images of {', '.join(plan.sequences)}"
    split = ": ".join(filter(None, (plan.split, f"tests are {', '.join(plan.test)}" if plan.test else "")))
    return (
        f"{len(results.rows)} results of {config.name} on {source} ({split}): {len(frames)} fold"
        f"{'s' * (len(frames) != 1)}, {sum(frames.values())} labelled test frames, {plan.seeds} "
        f"seed{'s' * (plan.seeds != 1)}. All rows are in results.csv, those of each test sequence in sequences.csv."
        + f" {SIMULATED}"
        * (plan.split == LIGHT)
    )


def _of(jobs: Sequence[GridJob], setting: Setting) -> list[GridJob]:
    """The jobs of a setting with seed 0, one per fold."""
    return [job for job in jobs if (job.size, job.seed, job.work.select) == (setting.size, 0, setting.select)]


def _beliefs(jobs: Sequence[GridJob], setting: Setting) -> list[Beliefs]:
    """The beliefs of a setting with seed 0 over the test sequences of all folds, by their names there (`_told`)."""
    cell = GridCell(setting.smoothing, setting.order, setting.transition)
    return [
        replace(one, stream=replace(one.stream, name=_told(job, one.name)))
        for job in _of(jobs, setting)
        for one in believe_cell(job.work, cell)
    ]


def _told(job: GridJob, sequence: str) -> str:
    """The name of a test sequence, and the light that it is seen in."""
    return f"{sequence}, simulated: {job.fold.light}" if job.fold.light else sequence


def _closer_look(results: Results, jobs: Sequence[GridJob]) -> Iterator[str]:
    """Belief strips and confusion matrices of the best setting, and its words."""
    best = ranked(results)[0]
    first = best._replace(order=min(row.order for row in results.rows))
    of = {setting: _beliefs(jobs, setting) for setting in dict.fromkeys((best, first))}
    found = {setting: evaluate(beliefs) for setting, beliefs in of.items()}
    drives = drives_of({str(setting): beliefs for setting, beliefs in of.items()})
    tests = {
        _told(job, one.sequence.name): one.sequence for job in _of(jobs, best) if job.images for one in job.images.test
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield heading("Belief over time")
        yield paragraph(f"{best}, seed 0, all folds. Point at a moment:")
        caption = f"The sequences with the most and the fewest frames right: {best}, seed 0."
        strips = folder / "strips.png"
        draw_strips(of[best], found[best], strips, 11)
        yield explorer(drives, shown_of(drives, tests, None))
        yield f'<div class="still">{picture(strips, "Beliefs of two test sequences", caption)}</div>'
        yield heading("What is confused")
        for number, (setting, evaluation) in enumerate(found.items()):
            path = folder / f"confusion{number}.png"
            draw_confusion(evaluation, path)
            yield picture(path, "Confusion matrix", f"{setting}, seed 0, all folds.")
        job = _of(jobs, best)[0]
        if (images := job.images) is not None:
            yield heading("The words")
            sequences = [one.sequence for one in images.test]
            words = word_table(Descriptors.concat([one.load() for one in images.test]), Dictionary.load(images.words))
            title = f"The words of S = {best.size}, seed 0, among the test frames"
            draw_word_sheet(words, typical_images(words, sequences), folder / "words.png", title=title)
            caption = f"{title} of the first fold ({job.fold.name})."
            yield picture(folder / "words.png", "For each word a typical frame", caption)


def _versions() -> str:
    lines = [
        f"placerec {__version__}",
        f"Python {platform.python_version()} on {platform.system()} {platform.machine()}",
    ]
    for package in _PACKAGES:
        try:
            lines.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            lines.append(f"{package}: not known")
    return "\n".join(lines)


def commands_of(plan: Config, setting: Setting, job: GridJob) -> str:
    """The commands that make a setting's result on the fold of `job`, run in the folder of the config."""
    lines, tokens = [], "tokens"
    if job.images is not None:
        sources = [[_from(plan, one.sequence.source) for one in part] for part in (job.images.train, job.images.test)]
        words = f"-o words.npz --size {setting.size} --seed {job.seed} --units {plan.units}"
        lines += [
            f"placerec train-words {_listed(sources[0])} --as-in-paper {words}",
            f"placerec tokenize {_listed(sources[0] + sources[1])} -w words.npz -o {tokens}/",
        ]
    else:
        tokens = _from(plan, job.work.train[0].parent)
    train, test = (_listed(f"{tokens}/{path.name}" for path in paths) for paths in (job.work.train, job.work.test))
    model = f"--order {setting.order} --smoothing {setting.smoothing} --select {setting.select}"
    learned = setting.transition == "learned"
    steps = "--transition learned" if learned else f"--stay {plan.stay:g} --per {plan.per}"
    lines += [
        f"placerec train-lm {train} --as-in-paper -o model/ {model}",
        f"placerec decode {test} -m model/ -o beliefs/ {steps}",
        "placerec evaluate beliefs/",
    ]
    return "\n".join(lines)


def _from(plan: Config, path: Path) -> str:
    """The path as seen from the config's folder, if it is below it."""
    found = relpath(path, plan.folder)
    return str(path) if found.startswith("..") else found


def _listed(paths: Iterable[str]) -> str:
    return " ".join(map(shlex.quote, paths))
