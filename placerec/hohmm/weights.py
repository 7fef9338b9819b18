"""How much words weigh against the prediction: two numbers, chosen by what they do on sequences that were held out.

alpha is the exponent of every word's probability, what speech recognition calls the acoustic scale: neighbouring frames
are not independent of each other, and several words of one frame are not either. memory (lambda) is how much of the
belief each frame replaces by the places' shares of the training frames: how fast the filter forgets. Both have the
least mean -log b(true place) over the labelled frames of sequences whose words trained nothing of what judges them.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm.evidence import Evidence
from placerec.hohmm.transitions import learned_transition
from placerec.lm.logs import LN10

ALPHAS = (1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.12, 0.09, 0.06, 0.04, 0.03, 0.02, 0.01)
MEMORIES = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0)
# No belief is smaller for the log loss, as in `placerec.evaluation`: one frame must not decide alone.
_SMALLEST_BELIEF = 1e-15
# So many groups are all better without a view by chance in less than one case of twenty.
LEAST_GROUPS = 5


@dataclass(frozen=True)
class ViewWorth:
    """What the words of a view are worth: the log loss that is left without them, in nats per frame.

    `better`: how many of `groups` of held-out sequences have less log loss without the view's words.
    """

    without: float
    better: int
    groups: int


@dataclass(frozen=True)
class Weights:
    """The exponent `alpha` of words' probabilities and the filter's `memory`.

    `log_loss`: nats per frame that they leave on `frames` held-out ones, and `unweighted` what alpha 1 and memory 0
    leave; None where there was nothing to choose by. `views`: what the words of each view are worth, if that was asked.
    """

    alpha: float
    memory: float
    log_loss: float | None = None
    unweighted: float | None = None
    frames: int = 0
    views: Mapping[str, ViewWorth] = field(default_factory=dict)

    @property
    def superfluous(self) -> str | None:
        """The view without which least log loss is left, if every group of LEAST_GROUPS or more has less without it.

        A view that is worth little where it is judged may be worth much in another building: least log loss alone
        leaves out too much (docs/recognizer.md).
        """
        bad = [
            (one.without, name)
            for name, one in self.views.items()
            if LEAST_GROUPS <= one.groups == one.better and self.log_loss is not None and one.without < self.log_loss
        ]
        return min(bad)[1] if bad else None


@dataclass(frozen=True)
class HeldOut:
    """A sequence that was held out: what its words say by the models of the others, and where it truly was.

    `evidence`: of all of its frames, with `alpha` 1. `truth` int64 (n,): the place of each frame, -1 for one that is
    not judged. `steps` int64 (C, C): how often, in the others, a frame of a place is followed by one of another.
    `shares` float64 (C,): the places' shares of their frames. `group`: the number of the sequences that were held out
    together with it. `views`: that of each dictionary, where it is to be told what they are worth.
    """

    evidence: Evidence = field(repr=False)
    truth: Ints = field(repr=False)
    steps: Ints = field(repr=False)
    shares: Floats = field(repr=False)
    group: int = 0
    views: tuple[str, ...] = ()

    def without(self, view: str) -> "HeldOut":
        """The sequence without the words of a view, one of several."""
        others = [number for number, own in enumerate(self.views) if own != view]
        return replace(self, evidence=replace(self.evidence, own=self.evidence.own[others]))


def shares_of(frames: Ints) -> Floats:
    """The places' shares of training frames, given their numbers int64 (C,); 1/C of a frame is added to each."""
    shares: Floats = (frames + 1 / len(frames)) / (frames.sum() + 1)
    return shares


def choose_weights(sequences: Iterable[HeldOut], dictionaries: int) -> Weights:
    """The best of ALPHAS x MEMORIES on the frames of held-out sequences with words of several `dictionaries`.

    Of equally good ones the first. Without a frame to judge: alpha 1 / `dictionaries`, memory 0. Each of several views
    that all sequences have words of is left out in turn, for `Weights.views`.
    """
    frames, sums = _losses_of_groups(sequences)
    judged = sum(frames.values())
    if not judged:
        return Weights(1 / dictionaries, 0.0)
    of_all = sums.pop("")
    total: Floats = np.sum([*of_all.values()], axis=0)
    memory, alpha = np.unravel_index(int(total.argmin()), total.shape)
    unweighted = total[MEMORIES.index(0.0), ALPHAS.index(1.0)]
    worth = {}
    for view, without in sums.items():
        better = sum(bool(without[group].min() < of_all[group].min()) for group in +frames)
        worth[view] = ViewWorth(_told(np.sum([*without.values()], axis=0).min(), judged), better, len(+frames))
    return Weights(
        ALPHAS[alpha], MEMORIES[memory], _told(total.min(), judged), _told(unweighted, judged), judged, worth
    )


def _losses_of_groups(sequences: Iterable[HeldOut]) -> tuple[Counter[int], dict[str, dict[int, Floats]]]:
    """How many frames of each group are judged, and their `losses` without the words of each view, "" for none."""
    frames = Counter[int]()
    sums: dict[str, dict[int, Floats]] = {}
    for sequence in sequences:
        views = dict.fromkeys(sequence.views)
        parts = {"": sequence} | ({view: sequence.without(view) for view in views} if len(views) > 1 else {})
        # What one sequence lacks cannot be told of all frames.
        sums = {view: sums.get(view, {}) for view in parts if view in sums or not frames}
        frames[sequence.group] += int((sequence.truth >= 0).sum())
        for view, of_groups in sums.items():
            of_groups[sequence.group] = of_groups.get(sequence.group, 0.0) + losses(parts[view])
    return frames, sums


def _told(loss: float, frames: int) -> float:
    """The loss of a frame, in six digits: a file to read, and the last bits of a sum differ from machine to machine."""
    return max(0.0, float(f"{loss / frames:.6g}"))


def losses(sequence: HeldOut) -> Floats:
    """The sum of -log b(true place) over the judged frames, for each of MEMORIES and ALPHAS: (memories, alphas).

    The filters of all of them go on side by side, word by word.
    """
    part = sequence.evidence
    transitions = [learned_transition(sequence.steps, memory, sequence.shares) for memory in MEMORIES]
    powers: dict[float, Floats] = {}
    judged = _judged(sequence)
    C = len(sequence.steps)
    belief = np.full((len(MEMORIES), len(ALPHAS), C), 1 / C)
    loss: Floats = -(np.log(belief) * judged[0]).sum(axis=2)
    for t, (likelihoods, elapsed) in enumerate(
        zip(_powers(part.log10_likelihoods), part.elapsed.tolist(), strict=True)
    ):
        if t:
            if elapsed not in powers:
                powers[elapsed] = np.array([transition.over(elapsed) for transition in transitions])
            # Not BLAS, whose sums depend on the number of its threads.
            belief = np.einsum("lac,lcd->lad", belief, powers[elapsed])
        belief *= likelihoods
        belief /= belief.sum(axis=2, keepdims=True)
        if judged[t + 1].any():
            loss -= (np.log(np.maximum(belief, _SMALLEST_BELIEF)) * judged[t + 1]).sum(axis=2)
    return loss


def _powers(log10_likelihoods: Floats) -> Floats:
    """The likelihoods to the power of each of ALPHAS, the largest of each word 1: (U, alphas, C)."""
    top = log10_likelihoods.max(axis=1, keepdims=True, initial=-np.inf)
    possible = np.isfinite(top)
    relative = np.where(possible, log10_likelihoods - np.where(possible, top, 0.0), 0.0)
    likelihoods: Floats = np.exp(np.array(ALPHAS)[:, None] * (relative * LN10)[:, None, :])
    return likelihoods


def _judged(sequence: HeldOut) -> Floats:
    """How many judged frames of each place follow each of U updates, and none: (U + 1, C)."""
    updates, C = sequence.evidence.updates, len(sequence.steps)
    known = sequence.truth >= 0
    at = updates[known] * C + sequence.truth[known]
    counts: Floats = np.bincount(at, minlength=(len(sequence.evidence.at) + 1) * C).astype(np.float64)
    return counts.reshape(-1, C)
