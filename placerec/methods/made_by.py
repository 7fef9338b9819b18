"""beliefs.json, beside the beliefs files of one `decode`: the model and the options that made them.

A JSON object: `format`, `version`, `method`, the model's `order`, `smoothing` and `select`, how many words each of its
`dictionaries` has, by the column of their words, and the options of `decoding` by which they were used.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from placerec.errors import EvaluationError, counted
from placerec.files import read_text
from placerec.methods.decoders import HOHMM
from placerec.model import Decoding, PlaceModels
from placerec.model.decoding import resolved
from placerec.version import __version__
from placerec.words.stream import column_of

BELIEFS_JSON = "beliefs.json"
_FORMAT = "placerec beliefs 1"


def describe_making(method: str, models: PlaceModels, options: Decoding) -> str:
    """The text of beliefs.json."""
    description = models.description.values
    made = {
        "format": _FORMAT,
        "version": __version__,
        "method": method,
        **{name: description.get(name) for name in ("order", "smoothing", "select")},
        "dictionaries": {
            column_of(name): one.description.values.get("vocabulary") for name, one in models.dictionaries.items()
        },
        # Other methods have neither transitions nor weights of the model's.
        "decoding": vars(resolved(models, options)) if method == HOHMM else {},
    }
    return json.dumps(made, indent=2, ensure_ascii=False) + "\n"


def makers_of(files: Iterable[Path]) -> tuple[str, ...]:
    """What made beliefs files, each model with its options once, as people read it; none where no beliefs.json is.

    Raises EvaluationError for a beliefs.json that says something else.
    """
    folders = dict.fromkeys(path.parent for path in files)
    return tuple(dict.fromkeys(_told(folder / BELIEFS_JSON) for folder in folders if (folder / BELIEFS_JSON).exists()))


def _told(path: Path) -> str:
    try:
        made = json.loads(read_text(path, EvaluationError))
        if made["format"] != _FORMAT:
            raise ValueError(made["format"])
        return _sentence(made)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise EvaluationError(f"{path}: does not say what made the beliefs beside it; decode again") from error


def _sentence(made: Mapping[str, Any]) -> str:
    sizes = [str(size) for size in made["dictionaries"].values()]
    words = f"{sizes[0]} words" if len(sizes) == 1 else f"{len(sizes)} dictionaries ({', '.join(sizes)} words)"
    parts = [made["method"]] if made["method"] != HOHMM else [f"order {made['order']}", made["smoothing"]]
    parts += [words] + ([f"select {made['select']}"] if made["select"] != "none" else [])
    options = made["decoding"]
    if options:
        stay, per = options["stay"], options["per"]
        fixed = "".join(f", {name} {value}" for name, value in (("stay", stay), ("per", per)) if value is not None)
        parts.append(f"transitions {options['transition']}{fixed}")
        parts.append(f"alpha {options['alpha']:g}, memory {options['memory']:g}")
        parts += [name for name in ("smooth", "viterbi", "calibrated", "unknown") if options[name]]
        parts += [f"lag of {counted(options['lag'], 'frame')}"] if options["lag"] is not None else []
    return ", ".join(map(str, parts))
