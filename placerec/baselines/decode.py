"""`decode --method`: any system in the place of the models' filter, from the same MODEL/ folder."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from placerec.baselines.follower import Follower
from placerec.baselines.lesson import read_lesson
from placerec.baselines.methods import HOHMM, METHODS, NEED_DESCRIPTORS
from placerec.errors import ModelError
from placerec.hohmm import Beliefs, Recognizer
from placerec.model import Decoder, Decoding, PlaceModels, load_model, make_recognizer
from placerec.model import decode as decode_with
from placerec.model.decoding import PAPER

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
        raise ModelError(f"{name} has no use for the language models: it takes no scorer")
    if METHODS[name].emissions is None:
        strange = [f.name for f in fields(options) if f.name != "max_gap" and getattr(options, f.name) != f.default]
        if strange:
            raise ModelError(f"{name} works without the filter, to which {strange[0]} belongs; leave it out")


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
    ModelError as `check_method`, `read_lesson` and `make_recognizer` do.
    """
    check_method(name, options, scorer=scorer)
    # Also where it is not used: what is wrong with model, dictionary and transitions is found here.
    recognizer = make_recognizer(model, options=options, dictionary=dictionary, scorer=scorer)
    method = METHODS[name]
    if method.emissions is not None:
        return Recognizer(
            model.models,
            selection=model.selection,
            transition=recognizer.transition,
            dictionary=dictionary,
            max_gap=options.max_gap,
            emissions=method.emissions(read_lesson(model)),
        )
    if method.follow is not None:
        lesson = read_lesson(model)
        follow = method.follow(lesson)
        return Follower(lesson.places, lesson.vocabulary, follow, selection=model.selection, max_gap=options.max_gap)
    return recognizer


def load_decoder(name: str, path: Path | str, *, options: Decoding = PAPER, scorer: str = "native") -> Decoder:
    """What `make_decoder` gives for a MODEL/ folder."""
    return make_decoder(name, load_model(path), options=options, scorer=scorer)


def decode(sources: Sequence[Path | str], model: Path | str, *, method: str = HOHMM, **more: Any) -> list[Beliefs]:
    """`placerec decode --method`: as `placerec.model.decode`, by the method of that name."""

    def make(models: PlaceModels, **options: Any) -> Decoder:
        return make_decoder(method, models, **options)

    return decode_with(sources, model, make=make, **more)
