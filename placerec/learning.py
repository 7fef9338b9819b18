"""`placerec learn`: words, models and the weight of words from images, and how good they are on sequences kept back."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from placerec.errors import counted
from placerec.evaluation.metrics import Evaluation, evaluate
from placerec.frames import SourceOptions
from placerec.jobs import Executor, Progress
from placerec.methods import decode
from placerec.model import ModelOptions
from placerec.model.folder import BELIEFS, LearnedEvidence
from placerec.model.learn import learn_model
from placerec.vision import DescriptorSpec, DictionarySet, DictionarySetOptions


@dataclass(frozen=True)
class Learned:
    """What `learn` made: dictionaries, the weight of their words, and the judgement of the tests, if any."""

    out: Path
    dictionaries: DictionarySet
    evidence: LearnedEvidence
    evaluation: Evaluation | None


def learn(
    sources: Iterable[Path | str],
    out: Path | str,
    *,
    test: Iterable[Path | str] = (),
    spec: DescriptorSpec | None = None,
    matrix: Path | str | None = None,
    source_options: SourceOptions = SourceOptions(),
    words: DictionarySetOptions = DictionarySetOptions(),
    options: ModelOptions = ModelOptions(),
    work: Executor | None = None,
    cache: Path | str | None = None,
    progress: Progress | None = None,
) -> Learned:
    """`placerec learn`: write the MODEL/ folder `out` (`placerec.model.learn.learn_model`), and decode `test`.

    These sequences train nothing, though `sources` may name them; the beliefs in them go to MODEL/beliefs/. Other
    arguments, and what is raised: see `placerec.model.learn.learn_model`, and `placerec.methods.decode`.
    """
    path, tests = Path(out), list(test)
    evidence = learn_model(
        sources,
        path,
        spec=spec,
        matrix=matrix,
        source_options=source_options,
        words=words,
        options=options,
        left_out=tests,
        work=work,
        cache=cache,
        progress=progress,
    )
    evaluation = None
    if tests:
        beliefs = decode(
            tests,
            path,
            network=spec.network.file if spec and spec.network else None,
            out=path / BELIEFS,
            source_options=source_options,
            cache=cache,
            progress=progress,
        )
        evaluation = evaluate(beliefs)
    return Learned(path, DictionarySet.load(path / "words.npz"), evidence, evaluation)


def format_learned(learned: Learned) -> str:
    """What was chosen and why, in five lines at most."""
    made, evidence = learned.dictionaries, learned.evidence
    quality = made.dictionaries[0].quality
    sizes = ", ".join(f"{size} x {size}" for size in made.options.sizes)
    worth = evidence.weights.views
    views = ", ".join(f"{view} ({worth[view].without:.3f})" if view in worth else view for view in made.options.views)
    without = "; in brackets the log loss without a view" if worth else ""
    learned_from = f"{counted(quality.used, 'frame')} of {counted(len(made.sequences), 'sequence')}"
    lines = [
        f"words     of {views}, {sizes} each: learned from {learned_from}{without}",
        f"places    {len(evidence.frames)}: " + ", ".join(f"{place} {n}" for place, n in evidence.frames.items()),
        f"weights   {evidence}",
    ]
    found = learned.evaluation
    if found is not None:
        loss, majority = found.log_loss, found.majority_accuracy
        tested = f"{counted(found.frames, 'frame')} of {counted(len(found.sequences), 'sequence')}"
        lines.append(
            f"tests     accuracy {100 * found.accuracy:.1f} % (majority class {100 * majority:.1f} %), log loss "
            f"{loss:.3f}, calibration error (ECE) {found.ece:.3f} on {tested}"
        )
    more = "nothing else" if made.spec.network is None else "--network FILE, the file of the network, and nothing else"
    lines.append(f"model     {learned.out}: `placerec decode SOURCE -m {learned.out}` needs {more}")
    return "\n".join(lines)
