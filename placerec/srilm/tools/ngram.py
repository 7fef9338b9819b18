"""`ngram`: scores text with models, and mixes and prunes them; sections 8 to 11 of our SRILM specification."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from placerec.arrays import Singles
from placerec.lm.score import TokenSequence
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START
from placerec.srilm.model.arpa_lookup import read_tables
from placerec.srilm.model.scorers import Model, Scorer, event_mask
from placerec.srilm.text.sentences import Handling
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.text.vocabulary import PAUSE, WordList, format_words, read_aliases, read_words
from placerec.srilm.tools.ngram_options import OPTIONS
from placerec.srilm.tools.options import Parsed, parse
from placerec.srilm.tools.reports import TOKENS, Printer, print_perplexity

if TYPE_CHECKING:
    from placerec.srilm.tools.ngram_models import Models

TOOL = "ngram"
# With these options alone the model is only asked for probabilities. What other options need is loaded where they are
# met: most runs score, and a tool should start about as fast as numpy is imported.
_SCORING = {
    *("order", "debug", "lm", "vocab", "vocab-aliases", "nonevents", "limit-vocab", "unk", "map-unk", "tolower"),
    *("ppl", "no-sos", "no-eos", "reverse", "noise", "noise-vocab", "text-has-weights", "text-has-weights-last"),
    *("escape", "counts", "count-order", "float-counts", "write-vocab"),
}


@exit_status
def ngram(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Run `ngram` with these arguments; returns the exit status."""
    options = parse(tool, OPTIONS, arguments, streams)
    if options["null"] and options["lm"] is not None:
        raise SrilmError("-null, -lm, and -use-server are mutually exclusive", 2)
    if not options["null"] and options["lm"] is None:
        raise SrilmError("need at least an -lm file specified", 1)
    # Log 0 is infinite: what comes of it is printed as SRILM prints it.
    with np.errstate(all="ignore"):
        _Run(options, streams).run()
    return 0


class _Run:
    """One run: the options, the words, and the models if they are more than something that scores."""

    def __init__(self, options: Parsed, streams: Streams) -> None:
        self.options = options
        self.streams = streams
        self.order = max(1, options["order"])
        self.words = self.read_words()

    def run(self) -> None:
        """Sections 9.1 to 9.10, in this order."""
        options = self.options
        models = None if options["debug"] <= TOKENS and options.given <= _SCORING else self.models()
        scorer = models.scorer() if models else self.scorer()
        self.words = models.words if models else self.words
        handling = self.handling()
        printer = Printer(self.words, self.streams, options["debug"])
        if options["ppl"]:
            print_perplexity(options["ppl"], scorer, printer, handling, whole=options["cache"] > 0)
        if options["counts"]:
            self.print_counts(scorer, printer)
        if options["gen"]:
            self.generate(scorer)
        if models and options["write-lm"]:
            models.write(options["write-lm"])
        if options["write-vocab"]:
            self.streams.write(options["write-vocab"], format_words(self.words))

    def models(self) -> "Models":
        """The models that are mixed, changed or written."""
        from placerec.srilm.tools.ngram_models import Models

        return Models(self.options, self.words, self.streams)

    def scorer(self) -> Scorer:
        """The model of -lm, which is only asked for probabilities."""
        options = self.options
        tables = read_tables(
            options["lm"],
            self.words,
            self.streams,
            order=self.order,
            debug=options["debug"],
            limited=options["limit-vocab"],
        )
        return Model(lambda: tables, self.words)

    def read_words(self) -> WordList:
        """The words that the options name."""
        options = self.options
        words = WordList(lower=options["tolower"], open_unknown=options["unk"])
        if options["vocab"]:
            read_words(words, options["vocab"], self.streams)
        if options["vocab-aliases"]:
            read_aliases(words, options["vocab-aliases"], self.streams)
        if options["map-unk"]:
            words.map_unknown(options["map-unk"])
        if options["nonevents"]:
            read_words(words, options["nonevents"], self.streams, silent=True)
        return words

    def handling(self) -> Handling:
        """What is done to the sentences of `-ppl`."""
        options = self.options
        noise = {self.words.add(PAUSE)}
        if options["noise"]:
            noise.add(self.words.add(options["noise"]))
        if options["noise-vocab"]:
            for line in self.streams.lines(options["noise-vocab"]):
                noise |= {self.words.add(word) for word in tokens(line)[:1]}
        return Handling(
            start=not options["no-sos"],
            end=not options["no-eos"],
            reverse=options["reverse"],
            weight="last" if options["text-has-weights-last"] else "first" if options["text-has-weights"] else "",
            escape=options["escape"],
            verbose=options["debug"] >= 1,
            noise=frozenset(noise),
        )

    def print_counts(self, scorer: Scorer, printer: Printer) -> None:
        """`-counts`."""
        from placerec.srilm.tools.count_report import Counting, print_counts

        options = self.options
        order = options["count-order"] or self.order
        counting = Counting(order, options["float-counts"], options["counts-entropy"], options["escape"])
        print_counts(options["counts"], scorer, printer, counting)

    def generate(self, scorer: Scorer) -> None:
        """`-gen`: sentences drawn from the model, behind each prefix if there are some."""
        from placerec.lm.score import generate

        options, index = self.options, self.words.index
        rng = np.random.Generator(np.random.PCG64(None if options["seed"] is None else abs(options["seed"])))
        start, end = index[SENTENCE_START], index[SENTENCE_END]
        events = event_mask(self.words)

        def spread(history: Sequence[int]) -> Singles:
            ids = np.array([*history, end], np.int64)
            place = np.arange(len(ids))
            view = scorer.view(TokenSequence(ids, place == 0, place == len(history)))
            return np.where(events, view.distribution(len(history)), np.float32(-np.inf))

        prefixes = map(tokens, self.streams.lines(options["gen-prefixes"])) if options["gen-prefixes"] else [[]]
        for prefix in prefixes:
            known = [self.words.known(word) for word in prefix]
            opening = [] if options["no-sos"] or known[:1] == [start] else [start]
            for _ in range(options["gen"]):
                drawn = generate(spread, [*opening, *known], end, rng, order=self.order)
                line = [*prefix, *(str(self.words.words[number]) for number in drawn)]
                self.streams.print(" ".join(line) + "\n")
