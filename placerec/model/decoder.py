"""What `decode` asks of whatever turns words into beliefs."""

from collections.abc import Callable
from typing import Protocol

from placerec.hohmm import Belief, Beliefs


class Decoder(Protocol):
    """Words in, beliefs out; a `Recognizer` is one."""

    @property
    def places(self) -> tuple[str, ...]:
        """The places, in the order of the beliefs."""

    @property
    def unknown(self) -> object | None:
        """None where nobody asks for the probability that the place is none of them."""

    @property
    def unexplained(self) -> int:
        """How many words no place could explain."""

    @property
    def decode(self) -> Callable[..., Beliefs]:
        """The beliefs over a sequence; the options of `Recognizer.decode` are named only if they are asked for."""

    def __contains__(self, word: str) -> bool: ...

    def reset(self) -> None:
        """Forget the sequence so far."""

    def update(self, word: str, /, time: float | None = None, distance: float | None = None) -> Belief:
        """The belief after one more frame, its word, and the distance to it."""

    def skip(self, time: float | None = None) -> Belief:
        """The belief after one more frame that has no word."""
