"""`ngram`: scores text with models, and mixes and prunes them; sections 8 to 11 of our SRILM specification."""

from collections.abc import Sequence

import numpy as np

from placerec.lm.backoff import Singles
from placerec.lm.counts import SENTENCE_END, SENTENCE_START
from placerec.lm.draft import Draft, reweigh, unite
from placerec.lm.generate import generate
from placerec.lm.mix import merge, merge_weight
from placerec.lm.passage import Passage
from placerec.lm.prune import prune, prune_improbable
from placerec.srilm.arpa import read_model
from placerec.srilm.arpa_text import format_draft
from placerec.srilm.context_order import ContextTimes, message_order
from placerec.srilm.count_report import Counting, print_counts
from placerec.srilm.messages import Messages
from placerec.srilm.ngram_options import OPTIONS
from placerec.srilm.options import Parsed, parse
from placerec.srilm.report import Printer, print_perplexity
from placerec.srilm.scorers import Cached, Lenient, LogLinear, Mixture, Model, Null, Scorer, event_mask
from placerec.srilm.sentences import Handling
from placerec.srilm.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.vocabulary import PAUSE, WordList, format_words, read_aliases, read_words

TOOL = "ngram"


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
    """One run: the options, the words, the model that can be written (None: there is none), and what scores."""

    def __init__(self, options: Parsed, streams: Streams) -> None:
        self.options = options
        self.streams = streams
        self.order = max(1, options["order"])
        self.debug = options["debug"]
        self.words = self.read_words()
        self.draft: Draft | None = None
        self.times: ContextTimes | None = None

    def run(self) -> None:
        """Sections 9.1 to 9.10, in this order."""
        options = self.options
        if options["null"]:
            scorer: Scorer = Null(self.words)
        else:
            self.draft, self.times = self.read("lm", "lm file")
            scorer = self.with_cache(self.mixed())
        scorer = self.lenient(scorer)
        if options["rescore-ngram"]:
            scorer = self.rescored(scorer)
        handling = self.handling()
        printer = Printer(self.words, self.streams, self.debug)
        if options["ppl"]:
            print_perplexity(options["ppl"], scorer, printer, handling, whole=options["cache"] > 0)
        if options["counts"]:
            print_counts(options["counts"], scorer, printer, self.counting())
        if options["gen"]:
            self.generate(scorer)
        if options["write-lm"]:
            self.write_model(options["write-lm"])
        if options["write-vocab"]:
            self.streams.write(options["write-vocab"], format_words(self.words))

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

    def read(
        self, option: str, what: str, *, order: int | None = None, words: WordList | None = None
    ) -> tuple[Draft, ContextTimes]:
        """Read the model that an option names."""
        return read_model(
            self.options[option],
            words or self.words,
            self.streams,
            order=order or self.order,
            debug=self.debug,
            limited=self.options["limit-vocab"] and words is None,
            what=what,
        )

    def together(self, *drafts: Draft) -> list[Draft]:
        """The models over one trie and all words known by now."""
        vocabulary, _ = self.words.sorted()
        if len(drafts) == 1 and drafts[0].trie.vocabulary.words == vocabulary.words:
            return [*drafts]
        names = np.array(self.words.names(vocabulary), np.int64)
        return unite(drafts, vocabulary, ~vocabulary.mask(self.words.non_events), names)

    def messages(self, draft: Draft) -> Messages:
        """Who says what happens to a model."""
        order = message_order(draft.trie, self.times) if self.times else None
        return Messages(draft.trie, self.streams, self.debug, weighed=order)

    def components(self) -> tuple[list[str], list[float]]:
        """The options that name models to mix in, and the weights of all models, -lm's first."""
        options = self.options
        if not options["mix-lm"]:
            return [], [1.0]
        more = [k for k in range(2, 10) if options[f"mix-lm{k}"]]
        shares = [options[f"mix-lambda{k}"] for k in more]
        rest = 1.0 - options["lambda"] - sum(options[f"mix-lambda{k}"] for k in range(2, 10))
        return ["mix-lm", *(f"mix-lm{k}" for k in more)], [options["lambda"], rest, *shares]

    def mixed(self) -> Scorer:
        """Static and dynamic mixtures, and what changes the model between them."""
        options = self.options
        others, weights = self.components()
        dynamic = options["bayes"] is not None or options["loglinear-mix"]
        if not dynamic:
            for k, option in enumerate(others, start=1):
                self.draft, other = self.together(self.model(), self.read(option, "mix-lm file")[0])
                merge(self.draft, other, merge_weight(weights, k), self.messages(self.draft))
        self.change()
        model = Model(self.model(), self.words, options["skipoovs"])
        if not dynamic or not others:
            return model
        models = [model, *(Model(self.read(option, "mix-lm file")[0], self.words) for option in others)]
        self.draft = None
        if options["loglinear-mix"]:
            return LogLinear(models, weights, self.words)
        return Mixture(models, weights, options["bayes"], options["bayes-scale"], self.debug == 3)

    def model(self) -> Draft:
        """The model that was read; there is one wherever this is called."""
        assert self.draft is not None
        return self.draft

    def change(self) -> None:
        """`-renorm`, `-prune` and `-prune-lowprobs`."""
        options = self.options
        if options["renorm"]:
            (draft,) = self.together(self.model())
            least = options["minbackoff"]
            reweigh(draft, self.messages(draft), minimum=least if least is not None and 0 <= least <= 1 else None)
            self.draft = draft
        if options["prune"] > 0:
            draft, history = self.pruned_by()
            trace = self.messages(draft)
            prune(draft, options["prune"], shortest=options["minprune"], history=history, trace=trace)
            self.draft = draft
        if options["prune-lowprobs"]:
            (draft,) = self.together(self.model())
            prune_improbable(draft, shortest=options["minprune"], trace=self.messages(draft))
            self.draft = draft

    def pruned_by(self) -> tuple[Draft, Draft | None]:
        """The model to prune and the one that says how probable contexts are."""
        if not self.options["prune-history-lm"]:
            return self.together(self.model())[0], None
        history, _ = self.read("prune-history-lm", "history LM file", order=max(1, self.order - 1))
        draft, wider = self.together(self.model(), history)
        return draft, wider

    def with_cache(self, scorer: Scorer) -> Scorer:
        """`-cache`."""
        if not self.options["cache"]:
            return scorer
        self.draft = None
        return Cached(scorer, self.words, self.options["cache"], self.options["cache-lambda"])

    def lenient(self, scorer: Scorer) -> Scorer:
        """`-zeroprob-word` and `-unk-prob`."""
        unknown_p, stand_in = self.options["unk-prob"], self.options["zeroprob-word"]
        if unknown_p is None and stand_in is None:
            return scorer
        if unknown_p == -99:
            unknown_p = -np.inf
        return Lenient(scorer, self.words, unknown_p, None if stand_in is None else self.words.add(stand_in))

    def rescored(self, scorer: Scorer) -> Scorer:
        """`-rescore-ngram` (section 11.6): another model's n-grams with the probabilities that `scorer` gives them."""
        options = self.options
        own = WordList(lower=options["tolower"], open_unknown=options["unk"])
        draft, self.times = self.read("rescore-ngram", "lm file", words=own)
        index, unknown = self.words.index, self.words.index[self.words.unknown]
        numbers = np.array([index.get(word, unknown) for word in draft.trie.vocabulary.words], np.int64)
        for n in range(draft.order, 0, -1):
            rows = np.flatnonzero(draft.stored[n - 1])
            passage = Passage.of_rows(numbers[draft.trie.matrix(n)[rows]])
            draft.log10_p[n - 1][rows] = scorer.view(passage).score().log10_p[n - 1 :: n]
        reweigh(draft, self.messages(draft))
        self.draft, self.words = draft, own
        return Model(draft, own)

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
            verbose=self.debug >= 1,
            noise=frozenset(noise),
        )

    def counting(self) -> Counting:
        """How `-counts` are scored."""
        options = self.options
        order = options["count-order"] or self.order
        return Counting(order, options["float-counts"], options["counts-entropy"], options["escape"])

    def generate(self, scorer: Scorer) -> None:
        """`-gen`: sentences drawn from the model, behind each prefix if there are some."""
        options, index = self.options, self.words.index
        rng = np.random.Generator(np.random.PCG64(None if options["seed"] is None else abs(options["seed"])))
        start, end, unknown = index[SENTENCE_START], index[SENTENCE_END], index[self.words.unknown]
        events = event_mask(self.words)

        def spread(history: Sequence[int]) -> Singles:
            ids = np.array([*history, end], np.int64)
            place = np.arange(len(ids))
            view = scorer.view(Passage(ids, place == 0, place == len(history)))
            return np.where(events, view.spread(len(history)), np.float32(-np.inf))

        prefixes = map(tokens, self.streams.lines(options["gen-prefixes"])) if options["gen-prefixes"] else [[]]
        for prefix in prefixes:
            known = [index.get(self.words.normal(word), unknown) for word in prefix]
            opening = [] if options["no-sos"] or known[:1] == [start] else [start]
            for _ in range(options["gen"]):
                drawn = generate(spread, [*opening, *known], end, rng, order=self.order)
                line = [*prefix, *(str(self.words.words[number]) for number in drawn)]
                self.streams.print(" ".join(line) + "\n")

    def write_model(self, name: str) -> None:
        """`-write-lm`."""
        if self.draft is None:
            self.streams.write(name, "")
            self.streams.say("write() method not implemented")
            self.streams.say(f"error writing {name}")
            return
        if self.debug >= 1:
            for n, stored in enumerate(self.draft.stored, start=1):
                self.streams.say(f"writing {int(stored.sum())} {n}-grams")
        self.streams.write(name, format_draft(self.draft))
