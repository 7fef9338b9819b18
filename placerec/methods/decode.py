"""`decode --method`: any system in the place of the models' filter, from the same MODEL/ folder."""

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from placerec.errors import ModelError
from placerec.frames import Reading
from placerec.hohmm import Beliefs
from placerec.jobs import Progress
from placerec.methods.follower import Follower
from placerec.methods.methods import HOHMM, METHODS, NEED_DESCRIPTORS
from placerec.methods.training_set import read_training_set
from placerec.model import Decoder, Decoding, PlaceModels, load_model, make_recognizer
from placerec.model import decode as decode_with
from placerec.model.decoding import PAPER
from placerec.model.recognize import check_words

if TYPE_CHECKING:
    from placerec.vision import Dictionary


def check_method(name: str, options: Decoding = PAPER, *, scorer: str = "native") -> None:
    """Raise ModelError if there is no method of this name for words alone, or if the options say nothing to it."""
    if name in NEED_DESCRIPTORS:
        raise ModelError(f"{name} needs descriptors, not words alone; `placerec compare` runs it")
    if name not in METHODS:
        raise ModelError(f"method {name!r} is unknown; choose one of {', '.join(METHODS)}")
    if name == HOHMM:
        return
    if scorer != "native":
        raise ModelError(f"{name} has no use for another scorer of the language models; leave it out")
    method, allowed = METHODS[name], {"max_gap"}
    if method.emissions is not None:
        allowed = {field.name for field in fields(options)} - {"calibrated", "explain"}
    elif method.fit_with_unknown is not None:
        allowed.add("unknown")
    for field in fields(options):
        if field.name not in allowed and getattr(options, field.name) != field.default:
            raise ModelError(f"{name} has no use for {field.name.replace('_', '-')}; leave it out")


def make_decoder(
    name: str,
    model: PlaceModels,
    *,
    options: Decoding = PAPER,
    dictionary: "Dictionary | None" = None,
    scorer: str = "native",
) -> Decoder:
    """What decodes by the method `name`, on-line or a sequence at a time; for `hohmm` this is `make_recognizer`.

    Systems that have emissions of their own go through the same filter, with the transitions of `options`. Raises
    ModelError as `check_method`, `read_training_set` and `make_recognizer` do.
    """
    check_method(name, options, scorer=scorer)
    method = METHODS[name]
    fit = method.fit_with_unknown if options.unknown and method.fit_with_unknown else method.fit
    if fit is None:
        emissions = method.emissions and method.emissions(read_training_set(model))
        return make_recognizer(model, options=options, dictionary=dictionary, scorer=scorer, emissions=emissions)
    check_words(model, dictionary)
    training = read_training_set(model)
    return Follower(
        training.places,
        training.vocabulary,
        fit(training),
        selection=model.selection,
        max_gap=options.max_gap,
        unknown=options.unknown,
    )


def load_decoder(name: str, path: Path | str, *, options: Decoding = PAPER, scorer: str = "native") -> Decoder:
    """What `make_decoder` gives for a MODEL/ folder."""
    return make_decoder(name, load_model(path), options=options, scorer=scorer)


def decode(
    sources: Sequence[Path | str],
    model: Path | str,
    *,
    method: str = HOHMM,
    words: Path | str | None = None,
    out: Path | str | None = None,
    reading: Reading = Reading(),
    options: Decoding = PAPER,
    scorer: str = "native",
    as_json: bool = False,
    progress: Progress | None = None,
) -> list[Beliefs]:
    """`placerec decode`: as `placerec.model.decode`, by the `method` of that name (METHODS)."""
    return decode_with(
        sources,
        model,
        words=words,
        out=out,
        reading=reading,
        options=options,
        scorer=scorer,
        as_json=as_json,
        progress=progress,
        make=partial(make_decoder, method),
    )
