"""The MODEL/ folder: the names of its files, and what model.json holds.

MODEL/PLACE.arpa             the language models: all that `decode` computes with
MODEL/model.json             places, options, what is recorded of the training, the equivalent `ngram-count` commands
MODEL/vocab.txt              all words
MODEL/sentences/PLACE.txt    what was counted
MODEL/counts/PLACE.counts    the counts
MODEL/nonevents.txt          without markers: what the `ngram-count` commands need to leave </s> out
MODEL/DICTIONARY/            the models of a further dictionary: a folder such as this one

What `learn` made the models of is there, too: MODEL/words.npz and MODEL/tokens/, and what they say of its tests:
MODEL/beliefs/.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from placerec.arrays import Floats
from placerec.errors import ModelError, PlacerecError, counted
from placerec.files import read_text, write_text
from placerec.frames.places import check_place
from placerec.hohmm import Calibration
from placerec.hohmm.unknown import Histogram
from placerec.hohmm.weights import ViewWorth, Weights, shares_of
from placerec.lm import BackoffModel, read_arpa
from placerec.model.options import ModelOptions
from placerec.model.record import LearnedSequence, Record, Route
from placerec.version import __version__
from placerec.words import Selection, Sentences, parse_selection, read_sentences
from placerec.words.folder import VOCABULARY
from placerec.words.stream import FIRST, column_of, dictionary_in

FORMAT = "placerec model 1"
MODEL_JSON = "model.json"
WORDS, TOKENS, BELIEFS = "words.npz", "tokens", "beliefs"
OWNED = ("*.arpa", MODEL_JSON, VOCABULARY, "nonevents.txt", "sentences", "counts", WORDS, TOKENS, BELIEFS)
_RETRAIN, _RECALIBRATE = "train the model again", "run `placerec calibrate` again"


class PlaceFiles(NamedTuple):
    """The files of one place in a MODEL/ folder."""

    arpa: Path
    sentences: Path
    counts: Path


@dataclass(frozen=True)
class ModelFolder:
    """A MODEL/ folder, or that of a further `dictionary` in one, which need not be there yet."""

    path: Path
    dictionary: str = FIRST

    def __str__(self) -> str:
        return str(self.path)

    @property
    def vocabulary(self) -> Path:
        """The file of all words."""
        return self.path / VOCABULARY

    @property
    def words(self) -> Path:
        """The file of the dictionaries, in a folder of `learn`."""
        return self.path / WORDS

    def place(self, place: str) -> PlaceFiles:
        """The files of a place."""
        return PlaceFiles(
            self.path / f"{place}.arpa",
            self.path / "sentences" / f"{place}.txt",
            self.path / "counts" / f"{place}.counts",
        )

    def of(self, dictionary: str) -> "ModelFolder":
        """The folder of one of the model's dictionaries; the first one's is the model's own."""
        return ModelFolder(self.path / dictionary, dictionary) if dictionary else self

    def describe(self, **changed: Any) -> None:
        """Change what model.json says."""
        ModelDescription.read(self.path / MODEL_JSON).write(**changed)

    def sentences(self, places: Sequence[str]) -> dict[str, Sentences]:
        """The sentences of each place; StreamError for a file that is missing or broken."""
        return {place: read_sentences(self.place(place).sentences) for place in places}


@dataclass(frozen=True)
class PlaceModels:
    """The language models of a MODEL/ folder, one per place in order, and what model.json says of them.

    `further`: those of further dictionaries, by the dictionary's name.
    """

    folder: ModelFolder
    models: Mapping[str, BackoffModel] = field(repr=False)
    description: "ModelDescription" = field(repr=False)
    further: Mapping[str, "PlaceModels"] = field(default_factory=dict, repr=False)

    @property
    def dictionaries(self) -> dict[str, "PlaceModels"]:
        """The models of each dictionary, by the dictionary's name; the first one's name is empty."""
        return {FIRST: self, **self.further}

    @property
    def fingerprints(self) -> dict[str, str | None]:
        """The fingerprint of each dictionary, None where it is unknown."""
        return {name: models.description.dictionary for name, models in self.dictionaries.items()}


@dataclass(frozen=True)
class LearnedEvidence:
    """How much words weigh, and what that was learned from: `evidence` in model.json.

    `sequences`: how many there were to learn from. `frames`: how many of them are labelled with each place.
    `dictionaries`: the fingerprint of each by name, None where it is unknown. `words`: whether the words were learned
    anew for each group of sequences that was held out, too, and not models and transitions alone.
    """

    weights: Weights
    sequences: int
    frames: Mapping[str, int]
    dictionaries: Mapping[str, str | None]
    words: bool = False

    def __str__(self) -> str:
        weights = self.weights
        chosen = f"alpha {weights.alpha:g}, memory {weights.memory:g}"
        if weights.log_loss is None:
            return f"{chosen}: not tried, for that takes several labelled sequences"
        return (
            f"{chosen}: log loss {weights.log_loss:.3f} instead of {weights.unweighted:.3f} on "
            f"{counted(weights.frames, 'frame')} of {self.sequences} sequences, each group of them judged by the others"
        )

    @property
    def shares(self) -> Floats:
        """The places' shares of the training frames, float64 (C,)."""
        return shares_of(np.array(list(self.frames.values()), np.int64))

    def as_dict(self) -> dict[str, Any]:
        """As model.json holds it."""
        weights = self.weights
        return {
            "alpha": weights.alpha,
            "memory": weights.memory,
            "log_loss": weights.log_loss,
            "unweighted_log_loss": weights.unweighted,
            "judged": weights.frames,
            **({"views": {name: vars(one) for name, one in weights.views.items()}} if weights.views else {}),
            "sequences": self.sequences,
            "redone": "words, models, transitions" if self.words else "models, transitions",
            "frames": dict(self.frames),
            "dictionaries": {column_of(name): fingerprint for name, fingerprint in self.dictionaries.items()},
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], places: Sequence[str]) -> "LearnedEvidence":
        """What `as_dict` gave; ValueError, KeyError, TypeError or AttributeError for anything else."""
        best, unweighted = (values[key] for key in ("log_loss", "unweighted_log_loss"))
        weights = Weights(
            float(values["alpha"]),
            float(values["memory"]),
            None if best is None else float(best),
            None if unweighted is None else float(unweighted),
            _count(values["judged"]),
            {
                name: ViewWorth(float(one["without"]), _count(one["better"]), _count(one["groups"]))
                for name, one in values.get("views", {}).items()
            },
        )
        if not (0 < weights.alpha < math.inf and 0 <= weights.memory <= 1):
            raise ValueError(weights)
        frames = {place: _count(values["frames"][place]) for place in places}
        dictionaries = {dictionary_in(column): fingerprint for column, fingerprint in values["dictionaries"].items()}
        if next(iter(dictionaries), None) != FIRST or any(map(check_place, [*dictionaries][1:])):
            raise ValueError(dictionaries)
        return cls(weights, _count(values["sequences"]), frames, dictionaries, "words" in values["redone"])


def load_model(path: Path | str) -> PlaceModels:
    """Read a MODEL/ folder; ModelError or LanguageModelError, naming the file, for anything missing or broken."""
    folder = ModelFolder(Path(path))
    if folder.path.exists() and not folder.path.is_dir():
        raise ModelError(f"{folder}: is a file, and the folder of a model is expected; name the folder")
    if not folder.path.exists():
        raise ModelError(f"{folder}: no such model folder; `placerec train-lm TOKENS... -o {folder}` makes one")
    first = _load(folder)
    evidence = first.description.evidence
    further = {name: _load(folder.of(name)) for name in [*evidence.dictionaries][1:]} if evidence else {}
    for other in further.values():
        if other.description.places != first.description.places:
            raise ModelError(f"{other.folder}: has other places than {folder}; {_RETRAIN}")
    return replace(first, further=further)


def owned_by(path: Path) -> tuple[str, ...]:
    """Patterns of what placerec wrote into a MODEL/ folder, if there is one: it may be replaced."""
    try:
        evidence = ModelDescription.read(path / MODEL_JSON).evidence
    except PlacerecError:
        evidence = None
    return (*OWNED, *([*evidence.dictionaries][1:] if evidence else ()))


def _load(folder: ModelFolder) -> PlaceModels:
    description = ModelDescription.read(folder.path / MODEL_JSON)
    models = {}
    for place in description.places:
        arpa = folder.place(place).arpa
        if not arpa.exists():
            raise ModelError(f"{arpa}: missing, though {MODEL_JSON} lists the place {place!r}; {_RETRAIN}")
        models[place] = read_arpa(arpa, tolerant=False)
    return PlaceModels(folder, models, description)


@dataclass(frozen=True)
class ModelDescription:
    """What model.json `path` says, as plain `values`; what is read from them raises ModelError if it is not usable."""

    path: Path
    values: Mapping[str, Any] = field(repr=False)

    @classmethod
    def read(cls, path: Path) -> "ModelDescription":
        """Read model.json; ModelError unless places, selection and dictionary are there and usable."""
        if not path.exists():
            raise ModelError(
                f"{path}: missing, so {path.parent} is no model of train-lm or learn; name the folder of one"
            )
        try:
            values = json.loads(read_text(path, ModelError))
        except ValueError as error:
            raise ModelError(f"{path}: is no JSON ({error}); {_RETRAIN}") from error
        if not isinstance(values, dict) or values.get("format") != FORMAT:
            raise ModelError(f"{path}: is not of the format {FORMAT!r}; {_RETRAIN}")
        places, dictionary = values.get("places"), values.get("dictionary", 0)
        if not isinstance(places, list) or not places or len(set(map(str, places))) < len(places):
            raise ModelError(f"{path}: 'places' must list the names of places, each once; {_RETRAIN}")
        for place in places:
            if reason := check_place(str(place)):
                raise ModelError(f"{path}: place {place!r} {reason}; {_RETRAIN}")
        if dictionary is not None and not isinstance(dictionary, str):
            raise ModelError(f"{path}: 'dictionary' must be a fingerprint or null; {_RETRAIN}")
        try:
            parse_selection(str(values.get("select")))
        except PlacerecError as error:
            raise ModelError(f"{path}: {error}; {_RETRAIN}") from error
        return cls(path, values)

    @classmethod
    def of(
        cls, folder: ModelFolder, places: Sequence[str], words: int, options: ModelOptions, record: Record
    ) -> "ModelDescription":
        """What model.json says of a new model of `words` words, which is not calibrated."""
        return cls(
            folder.path / MODEL_JSON,
            {
                "format": FORMAT,
                "version": __version__,
                "places": list(places),
                "order": options.order,
                "smoothing": options.smoothing,
                "delta": options.delta_used,
                "min_count": list(options.min_count),
                "markers": options.markers,
                "select": str(options.select),
                "vocabulary": words,
                **_describe_record(record),
                "calibration": None,
                "ngram_count": {place: options.ngram_count_command(place) for place in places},
            },
        )

    @property
    def places(self) -> list[str]:
        """The places, in the order of the beliefs' columns."""
        places: list[str] = self.values["places"]
        return places

    @property
    def selection(self) -> Selection:
        """Which words of a stream were counted."""
        return parse_selection(self.values["select"])

    @property
    def dictionary(self) -> str | None:
        """The fingerprint of the dictionary that made the training words, None if unknown."""
        fingerprint: str | None = self.values["dictionary"]
        return fingerprint

    @property
    def evidence(self) -> LearnedEvidence | None:
        """How much words weigh; None where nothing was learned of it, as in the paper: alpha is 1 then."""
        values = self.values.get("evidence")
        if values is None:
            return None
        try:
            return LearnedEvidence.from_dict(values, self.places)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ModelError(f"{self.path}: 'evidence' is not what training writes; {_RETRAIN}") from error

    @property
    def added_count(self) -> float:
        """What the smoothing adds to every count; 1 for a smoothing that adds nothing."""
        return float(self.values["delta"]) if str(self.values["smoothing"]).startswith("lidstone") else 1.0

    @property
    def trained_on(self) -> frozenset[str]:
        """The names of the training sequences."""
        return frozenset(one["name"] if isinstance(one, Mapping) else one for one in self.values.get("sequences", ()))

    @property
    def options(self) -> ModelOptions:
        """How the models were made."""
        keys = ("order", "smoothing", "delta", "min_count", "markers", "select")
        try:
            order, method, delta, min_count, markers, select = (self.values[key] for key in keys)
            options = ModelOptions(order, method, delta, tuple(min_count), markers, parse_selection(select))
            options.check()
        except (KeyError, TypeError) as error:
            raise ModelError(f"{self.path}: its options make no model; {_RETRAIN}") from error
        return options

    @property
    def record(self) -> Record:
        """What is recorded of the training sequences."""
        try:
            return _read_record(self.values)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise ModelError(
                f"{self.path}: does not say which visits were learned, as an older placerec or an editor leaves it; "
                f"{_RETRAIN}"
            ) from error

    @property
    def distances(self) -> list[Histogram] | None:
        """How far the training frames of each place lay from their words, None where that is unknown."""
        try:
            distances = _read_distances(self.values)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ModelError(f"{self.path}: 'distances' holds no numbers of frames; {_RETRAIN}") from error
        return None if distances is None else [distances[place] for place in self.places]

    @property
    def calibration(self) -> tuple[Calibration, Mapping[str, Any]] | None:
        """The calibration and the decoding that it was fitted for, None without one."""
        stored = self._stored()
        if stored is None:
            return None
        try:
            calibration = Calibration.from_json(stored)
        except ModelError as error:
            raise ModelError(f"{self.path}: {error}") from error
        options = stored.get("options")
        return calibration, options if isinstance(options, Mapping) else {}

    def measured_distances(self, dictionary: str = FIRST) -> tuple[float, float] | None:
        """Shift and variance of log2 distance to words of a dictionary, as the calibration measured them, if it did."""
        stored = (self._stored() or {}).get(column_of(dictionary).replace("word", "distances"))
        if stored is None:
            return None
        try:
            shift, variance = float(stored["shift"]), float(stored["variance"])
        except (KeyError, TypeError, ValueError):
            shift = variance = math.nan
        if not (math.isfinite(shift) and 0 <= variance < math.inf):
            raise ModelError(f"{self.path}: the calibration's distances are no shift and variance; {_RECALIBRATE}")
        return shift, variance

    def write(self, **changed: Any) -> None:
        """Write model.json, with `changed` values in place of those before."""
        write_text(self.path, _format({**self.values, **changed}, "") + "\n")

    def _stored(self) -> Mapping[str, Any] | None:
        stored = self.values.get("calibration")
        if stored is not None and not isinstance(stored, Mapping):
            raise ModelError(f"{self.path}: 'calibration' is none; {_RECALIBRATE}")
        return stored


def _format(value: Any, indent: str) -> str:
    """JSON text in which what holds nothing but whole numbers is on one line, the rest as `json` indents it."""
    inner = list(value.values()) if isinstance(value, dict) else value
    if not isinstance(value, dict | list) or all(isinstance(item, int) for item in inner):
        return json.dumps(value, ensure_ascii=False)
    texts = [_format(item, indent + "  ") for item in inner]
    if isinstance(value, dict):
        texts = [f"{json.dumps(key, ensure_ascii=False)}: {text}" for key, text in zip(value, texts, strict=True)]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return f"{opening}\n" + ",\n".join(f"{indent}  {text}" for text in texts) + f"\n{indent}{closing}"


def _describe_record(record: Record) -> dict[str, Any]:
    transitions, triples, distances = record.transitions, record.triples, record.distances
    steps = None
    if transitions is not None and triples is not None:
        listed = [[*route, int(triples[tuple(route)])] for route in np.argwhere(triples).tolist()]
        steps = {"counts": transitions.tolist(), "triples": listed}
    return {
        "sequences": [{"name": s.name, "visits": dict(s.visits)} for s in record.sequences],
        "dictionary": record.dictionary,
        "transitions": steps,
        "distances": distances
        and {place: {str(b): count for b, count in histogram.items()} for place, histogram in distances.items()},
    }


def _read_record(values: Mapping[str, Any]) -> Record:
    learned = tuple(
        LearnedSequence(str(item["name"]), {place: _count(n) for place, n in item["visits"].items()})
        for item in values["sequences"]
    )
    places, steps, distances = values["places"], values["transitions"], _read_distances(values)
    if Record(learned).places != places or (steps is None) != (distances is None):
        raise ValueError(places)
    routes = None if steps is None else _read_routes(steps, places)
    return Record(learned, values["dictionary"], routes, distances)


def _read_routes(steps: Mapping[str, Any], places: Sequence[str]) -> dict[Route, int]:
    counts = np.array([[*map(_count, row)] for row in steps["counts"]], np.int64)
    if counts.shape != (len(places), len(places)):
        raise ValueError(counts.shape)
    routes: dict[Route, int] = {(places[i], places[j]): int(counts[i, j]) for i, j in np.argwhere(counts).tolist()}
    for entry in steps["triples"]:
        i, j, k, count = map(_count, entry)
        if max(i, j, k) >= len(places) or j in (i, k):
            raise ValueError(entry)
        routes[places[i], places[j], places[k]] = count
    return routes


def _read_distances(values: Mapping[str, Any]) -> dict[str, Histogram] | None:
    known = values["distances"]
    return known and {place: {int(b): _count(n) for b, n in known[place].items()} for place in values["places"]}


def _count(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(value)
    return value
