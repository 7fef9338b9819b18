"""How a sequence is decoded, by which transitions and until what ends it, and the recognizer that does so."""

import json
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from placerec.errors import ModelError
from placerec.hohmm import Calibration, Recognizer
from placerec.hohmm.evidence import MARKERS, Emissions, SeparateEmissions
from placerec.hohmm.transitions import (
    PER,
    Per,
    Transition,
    fixed_transition,
    forgetting,
    learned_transition,
    read_transitions,
)
from placerec.hohmm.unknown import UnknownModel, unknown_model, word_runs
from placerec.lm.check import kenlm_scorer
from placerec.model.folder import PlaceModels, load_model
from placerec.words import WordStream
from placerec.words.folder import check_dictionary, read_streams, stream_files
from placerec.words.stream import FIRST

if TYPE_CHECKING:
    from placerec.vision import Dictionary, DictionarySet

log = logging.getLogger(__name__)

STAY: float = 0.99
_PER: Per = "update"
TransitionName = Literal["fixed", "learned"]
NAMED: tuple[str, ...] = get_args(TransitionName)
ScorerName = Literal["native", "kenlm"]


@dataclass(frozen=True)
class Decoding:
    """The options of `decode`; every name is that of the command line. Without any: what training learned.

    `transition`: `fixed` (`stay` on the diagonal, the rest shared), `learned` (what the training counted, to the power
    of the frames since the last update), or the path of a matrix (`read_transitions`); None: `learned` if training
    learned how much words weigh and neither `stay` nor `per` is given, else `fixed`. `stay`: None is 0.99. `per`: what
    one step of the transitions is, an `update`, a `frame`, or a `second` of the stream's time; None is `update`.
    `alpha`: the exponent of words' probabilities; None: what training learned, else 1. `memory`: the share of the
    belief that each step replaces by the places' shares of the training frames; None: with learned transitions what
    training learned, else 0.
    `max_gap`: more seconds than this between two frames begin a new sequence. Of `smooth` (all words count), `lag`
    (words up to so many frames later count) and `viterbi` (`best` is the most probable path) one at most. `calibrated`:
    apply the calibration of the model. `unknown`: weigh that the place is none of the model's. `explain`: write down
    what decided (`placerec.hohmm.explain`). Raises ModelError for options that exclude each other.
    """

    transition: TransitionName | Path | None = None
    stay: float | None = None
    per: Per | None = None
    alpha: float | None = None
    memory: float | None = None
    max_gap: float | None = None
    smooth: bool = False
    viterbi: bool = False
    lag: int | None = None
    calibrated: bool = False
    unknown: bool = False
    explain: bool = False

    def __post_init__(self) -> None:
        if self.per not in (*PER, None):
            raise ModelError(f"per {self.per!r} is unknown; choose one of {', '.join(PER)}")
        if self.transition == "learned" and (self.stay is not None or self.per is not None):
            raise ModelError("learned transitions are per frame: they take neither a stay probability nor `per`")
        if self.alpha is not None and not 0 < self.alpha < math.inf:
            raise ModelError(f"alpha {self.alpha:g} is no exponent above 0 for the probabilities of words")
        if self.memory is not None and not 0 <= self.memory <= 1:
            raise ModelError(f"memory {self.memory:g} is not between 0 and 1")
        if self.memory and self.per == "second":
            raise ModelError(
                "memory is per step, and transitions per second have parts of steps; choose update or frame"
            )
        if self.transition not in (*NAMED, None):
            if self.stay is not None:
                raise ModelError(f"{self.transition}: transitions of a file take no stay probability")
            if self.per == "second":
                raise ModelError(
                    f"{self.transition}: transitions of a file cannot be per second, since a matrix has no power for a "
                    "part of a second; choose update or frame"
                )
            if not Path(self.transition or "").exists():
                raise ModelError(f"{self.transition}: no such file; transitions are fixed, learned, or a file")
        if self.max_gap is not None and not self.max_gap > 0:
            raise ModelError(f"largest gap {self.max_gap:g} s is not above 0")
        if self.lag is not None and self.lag < 0:
            raise ModelError(f"lag {self.lag} is below 0")
        if self.smooth + self.viterbi + (self.lag is not None) > 1:
            raise ModelError("of smooth, viterbi and lag only one can be asked for")
        if self.explain and self.looks_ahead:
            raise ModelError("explain tells how the filter decides word by word: it takes none of smooth, viterbi, lag")

    @property
    def looks_ahead(self) -> bool:
        """Whether words count that come later."""
        return self.smooth or self.viterbi or self.lag is not None


# What training learned, or what the paper does if it learned nothing of it.
AS_LEARNED = Decoding()
# The paper's: the place stays with probability 0.99 at each selected word.
PAPER = Decoding(transition="fixed", alpha=1.0, memory=0.0)


def as_in_paper(options: Decoding) -> Decoding:
    """The options with the paper's in place of those that are not given."""
    fixed = "fixed" if options.transition is None else options.transition
    alpha, memory = (
        paper if given is None else given for given, paper in ((options.alpha, 1.0), (options.memory, 0.0))
    )
    return replace(options, transition=fixed, alpha=alpha, memory=memory)


def resolved(model: PlaceModels, options: Decoding) -> Decoding:
    """The options with what the training of `model` learned, or the paper's, in place of those that are not given."""
    evidence = model.description.evidence
    if evidence is None:
        return as_in_paper(options)
    weights, transition = evidence.weights, options.transition
    if transition is None:
        transition = "learned" if options.stay is None and options.per is None else "fixed"
    return replace(
        options,
        transition=transition,
        alpha=weights.alpha if options.alpha is None else options.alpha,
        memory=(weights.memory if transition == "learned" else 0.0) if options.memory is None else options.memory,
    )


def check_online(options: Decoding) -> None:
    """Raise ModelError for an option that needs later words, where each frame is answered before they are known."""
    for name in ("smooth", "viterbi", "lag"):
        if getattr(options, name) not in (False, None):
            raise ModelError(
                f"{name} needs later words, and a recognizer answers before they are known; "
                "give it to `decode`, the recognizer's or the package's"
            )


def transition_of(model: PlaceModels, options: Decoding) -> Transition:
    """The transitions that `options` ask for between the places of `model`.

    Raises ModelError if the model has no counts to learn from, for a file that cannot be read, or a probability that
    is none.
    """
    options = resolved(model, options)
    transition = _steps(model, options)
    if not options.memory:
        return transition
    evidence = model.description.evidence
    if evidence is None:
        raise ModelError(
            f"{model.folder}: does not say how many frames each place had, which memory needs; train it again"
        )
    return forgetting(transition, options.memory, evidence.shares)


def _steps(model: PlaceModels, options: Decoding) -> Transition:
    """The transitions without any forgetting."""
    per = options.per or _PER
    if options.transition == "fixed":
        return fixed_transition(len(model.models), STAY if options.stay is None else options.stay, per)
    if options.transition == "learned":
        counts = model.description.record.transitions
        if counts is None:
            raise ModelError(
                f"{model.folder}: was trained on sentences, which do not tell how often a place follows another; "
                "train it on token streams, or choose fixed transitions"
            )
        return learned_transition(counts)
    return Transition(read_transitions(Path(options.transition or ""), tuple(model.models)), per)


def describe_decoding(model: PlaceModels, options: Decoding) -> dict[str, Any]:
    """What the beliefs of `model` depend on, in plain values that do not tell in which words it was asked for.

    A file of transitions stands there as a matrix, rows in the order of the places.
    """
    options = resolved(model, options)
    fixed = options.transition == "fixed"
    transition = _steps(model, options)
    weights = {name: getattr(options, name) for name in ("alpha", "memory")}
    return {
        # As files of the paper's system have it, which say nothing of weights.
        **({} if weights == {"alpha": 1.0, "memory": 0.0} else weights),
        "transition": options.transition if options.transition in NAMED else transition.matrix.tolist(),
        "stay": (STAY if options.stay is None else options.stay) if fixed else None,
        "per": transition.per,
        "max_gap": options.max_gap,
        "smooth": options.smooth,
        "lag": options.lag,
    }


def load_recognizer(
    path: Path | str,
    *,
    options: Decoding = AS_LEARNED,
    dictionary: "Dictionary | DictionarySet | None" = None,
    scorer: ScorerName = "native",
) -> Recognizer:
    """The recognizer of a MODEL/ folder.

    `options`: its transitions, what ends a sequence, and what else is asked of it. `dictionary`: what turns images into
    words. `scorer`: `native`, or `kenlm` (MissingExtraError where it is not installed). Raises ModelError if the
    dictionary is not the one that made the training words, for options that need later words (give them to the
    recognizer's `decode`), and as `transition_of`, `calibration_of` and `unknown_model_of` do.
    """
    check_online(options)
    check_scorer(scorer)
    return make_recognizer(load_model(path), options=options, dictionary=dictionary, scorer=scorer)


def make_recognizer(
    model: PlaceModels,
    *,
    options: Decoding = AS_LEARNED,
    dictionary: "Dictionary | DictionarySet | None" = None,
    scorer: ScorerName = "native",
    emissions: Emissions | None = None,
) -> Recognizer:
    """The recognizer of a model that is loaded; see `load_recognizer`.

    `emissions`: in place of those of the first dictionary's models, which then stand alone.
    """
    check_words(model, dictionary)
    check_scorer(scorer)
    every = [model] if emissions is not None else [*model.dictionaries.values()]
    return Recognizer(
        model.models,
        further={} if emissions is not None else {name: one.models for name, one in model.further.items()},
        alpha=resolved(model, options).alpha or 1.0,
        selection=model.description.selection,
        transition=transition_of(model, options),
        dictionary=dictionary,
        max_gap=options.max_gap,
        emissions=[_kenlm(one) for one in every] if scorer == "kenlm" else emissions,
        calibration=calibration_of(model, options) if options.calibrated else None,
        unknown=unknown_models_of(model)[: len(every)] if options.unknown else None,
        explain=options.explain,
    )


def check_scorer(scorer: str) -> None:
    """Raise ModelError if nothing scores under this name."""
    if scorer not in get_args(ScorerName):
        raise ModelError(f"scorer {scorer!r} is unknown; choose {' or '.join(get_args(ScorerName))}")


def check_words(model: PlaceModels, dictionary: "Dictionary | DictionarySet | None") -> None:
    """Raise ModelError if `dictionary` is known not to be the one that made the words of `model`."""
    if dictionary is None:
        return
    several = getattr(dictionary, "dictionaries", ())
    made = {one.name: one.fingerprint for one in several} or {FIRST: dictionary.fingerprint}
    for name, trained_on in model.fingerprints.items():
        if trained_on is not None and made.get(name) != trained_on:
            raise ModelError(
                f"{model.folder}: was trained on the words of another dictionary than the one given; "
                "give the words.npz of its training, or train it again"
            )


def token_streams(sources: Sequence[Path | str], model: PlaceModels) -> list[WordStream]:
    """The token streams that `sources` name; StreamError if they are in other words than those of `model`."""
    check_dictionary(stream_files(sources), model.fingerprints, model.folder.path)
    return read_streams(sources)


def _kenlm(model: PlaceModels) -> SeparateEmissions:
    scorers = [kenlm_scorer(model.folder.place(place).arpa) for place in model.models]
    return SeparateEmissions(scorers, max(one.order for one in model.models.values()))


def calibration_of(model: PlaceModels, options: Decoding) -> Calibration:
    """The calibration in model.json; ModelError if there is none, or none that can be used.

    If it was fitted with other options than `options`, a warning names them. It is no error, since a temperature
    changes no decision.
    """
    stored = model.description.calibration
    if stored is None:
        raise ModelError(
            f"{model.folder}: is not calibrated; run `placerec calibrate {model.folder} TOKENS...` on labelled "
            "sequences that trained neither the words nor the model"
        )
    (calibration, fitted), asked = stored, describe_decoding(model, options)
    if fitted != asked:
        differ = [name for name in asked if fitted.get(name) != asked[name]]
        was = ", ".join(f"{name} {json.dumps(fitted.get(name))}" for name in differ)
        log.warning("%s: was calibrated for other options (%s); calibrate with those of now", model.folder, was)
    return calibration


def unknown_models_of(model: PlaceModels) -> list[UnknownModel]:
    """What a place that is none of the model's is weighed with, dictionary by dictionary.

    That is sentences and distances of the training, and the distances that the calibration measured. Raises StreamError
    or ModelError for a folder without sentences, and for a model.json that holds no such numbers.
    """
    found = []
    for name, one in model.dictionaries.items():
        vocabulary = sum(word not in MARKERS for word in next(iter(one.models.values())).words)
        runs = word_runs(one.folder.sentences(list(one.models)).values())
        measured = model.description.measured_distances(name)
        found.append(unknown_model(vocabulary, runs, one.description.distances, measured=measured))
    return found
