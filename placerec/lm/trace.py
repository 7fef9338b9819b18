"""What an estimation has to tell while it works: the base says nothing, a listener overrides what it wants to hear.

Contexts of order n are given as rows of order n-1 (row 0 stands for the empty context where n is 1).
"""

from placerec.arrays import Floats, Ints, Mask, Singles


class Trace:
    """Hears nothing."""

    def discarded_contexts(self, n: int, count: int) -> None:
        """`count` contexts of order n end in </s> or hold a closed <unk>."""

    def discarded_ngrams(self, n: int, non_events: int, discounted: int) -> None:
        """N-grams of order n left out: their last word is not predictable; their count is below the minimum."""

    def probabilities(
        self,
        n: int,
        attempt: int,
        rows: Ints,
        count: Floats,
        total: Floats,
        factor: Floats,
        lower: tuple[Floats, Singles] | None,
        log10_p: Singles,
    ) -> None:
        """All that went into the n-grams `rows` (m,): `lower` is weight and log10 p of the shorter context, if used."""

    def no_mass(self, n: int, attempt: int, contexts: Ints, mass: Floats, *, interpolated: bool) -> None:
        """Contexts that leave nothing to unseen words: done again without interpolation, or with a larger total."""

    def order_done(self, n: int) -> None:
        """All probabilities of order n are there; the weights of its contexts come next."""

    def full_contexts(self, n: int, contexts: Ints) -> None:
        """Contexts that have seen every word: their probabilities are scaled to sum to 1."""

    def overfull_contexts(self, n: int, contexts: Ints, mass: Floats) -> None:
        """Contexts whose probabilities sum to more than 1."""

    def scarce_contexts(self, n: int, contexts: Ints, mass: Floats, minimum: float) -> None:
        """Contexts that leave less than `minimum`: scaled."""

    def weights(self, n: int, contexts: Ints, num: Floats, den: Floats, weight: Singles) -> None:
        """Backoff weights, and the masses that they are the ratio of."""

    def unigram_mass(self, mass: float, words: int, *, everyone: bool) -> None:
        """Mass that goes to the words without probability, or to everyone."""

    def inserted(self, n: int, rows: Ints) -> None:
        """N-grams that got a line because a longer context needs them."""

    def trials(
        self, n: int, rows: Ints, context: Singles, old: Singles, new: Singles, entropy: Floats, gone: Mask
    ) -> None:
        """What taking out each of the n-grams `rows` (m,) of order n would do, and whether it is `gone`.

        `context`: log10 of the joint probability of its context; `old`, `new`: its log10 p with and without it;
        `entropy`: how far the model moves (relative entropy, base 10).
        """

    def pruned(self, n: int, rows: Ints) -> None:
        """N-grams of order n taken out, perhaps none."""


SILENT = Trace()
