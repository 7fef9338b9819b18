"""`ngram`: scores text with models, and mixes and prunes them; sections 8 to 11 of our SRILM specification."""

import os
from collections.abc import Sequence

import numpy as np

from placerec.lm.vocabulary import SENTENCE_START
from placerec.srilm.model.arpa_reader import read_tables
from placerec.srilm.model.scorers import Model, Scorer
from placerec.srilm.text.sentences import Handling, handling_of
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.text.vocabulary import PAUSE, WordList, format_words, read_aliases, read_words
from placerec.srilm.tools.options import Option, Options, Parsed, parse
from placerec.srilm.tools.reports import TOKENS, Counting, Printer, print_counts, print_perplexity

TOOL = "ngram"
BAD_WEIGHT = "bad sentence weight {}"


def _refuse(reason: str, **kinds: str) -> dict[str, Option]:
    return {name.replace("_", "-"): Option(kind, None, reason, refused=True) for name, kind in kinds.items()}


def _mixture_options() -> dict[str, Option]:
    options = {
        "mix-lm": Option("string", None, "a model to mix in"),
        "lambda": Option("float", 0.5, "the weight of -lm in a mixture"),
        "bayes": Option("unsigned", None, "mix while scoring, weighted by the last words (0: fixed weights)"),
        "bayes-scale": Option("float", 1.0, "the weight of what the last words say"),
        "loglinear-mix": Option("flag", False, "mix logarithms while scoring"),
    }
    for k in range(2, 10):
        options[f"mix-lm{k}"] = Option("string", None, f"model {k} to mix in")
        options[f"mix-lambda{k}"] = Option("float", 0.0, f"the weight of -mix-lm{k}")
    return options


OPTIONS: Options = {
    "order": Option("unsigned", 3, "largest n-gram length that is read and used"),
    "debug": Option("int", 0, "how much to say"),
    "lm": Option("string", None, "the language model"),
    "null": Option("flag", False, "give every word probability 1"),
    "vocab": Option("string", None, "words to add to those of the model"),
    "vocab-aliases": Option("string", None, "other names of words"),
    "nonevents": Option("string", None, "words that are never predicted"),
    "limit-vocab": Option("flag", False, "leave out n-grams with words that -vocab does not list"),
    "unk": Option("flag", False, "<unk> is a word like others"),
    "map-unk": Option("string", None, "the word to use for <unk>"),
    "tolower": Option("flag", False, "A to Z become a to z"),
    **_mixture_options(),
    "cache": Option("unsigned", 0, "mix with the frequencies of this many recent words"),
    "cache-lambda": Option("float", 0.05, "the weight of -cache"),
    "renorm": Option("flag", False, "recompute backoff weights"),
    "minbackoff": Option("float", None, "with -renorm: the least mass left for backing off"),
    "prune": Option("float", 0.0, "leave out n-grams that change perplexity by less"),
    "minprune": Option("unsigned", 2, "shortest n-grams to prune"),
    "prune-lowprobs": Option("flag", False, "leave out n-grams less probable than by backing off"),
    "prune-history-lm": Option("string", None, "the model that says how probable contexts are, for -prune"),
    "no-sos": Option("flag", False, "do not put <s> in front of sentences"),
    "no-eos": Option("flag", False, "do not put </s> behind sentences"),
    "reverse": Option("flag", False, "score sentences from last word to first"),
    "noise": Option("string", None, "a word to leave out of sentences"),
    "noise-vocab": Option("string", None, "words to leave out of sentences"),
    "skipoovs": Option("flag", False, "probability 0 for unknown words and the two words behind them"),
    "unk-prob": Option("float", None, "the log10 probability of unknown words"),
    "zeroprob-word": Option("string", None, "the word whose probability stands in for 0"),
    "rescore-ngram": Option("string", None, "give the n-grams of this model the probabilities of ours"),
    "ppl": Option("string", None, "the text to score"),
    "text-has-weights": Option("flag", False, "lines begin with a weight"),
    "escape": Option("string", None, "the start of lines to copy"),
    "counts": Option("string", None, "the counts to score"),
    "count-order": Option("unsigned", 0, "largest n-gram length of -counts (0: -order)"),
    "counts-entropy": Option("flag", False, "weight -counts by joint probabilities"),
    "float-counts": Option("flag", False, "counts are real numbers"),
    "gen": Option("unsigned", 0, "this many sentences at random"),
    "gen-prefixes": Option("string", None, "starts of sentences for -gen"),
    "seed": Option("int", None, "of the random numbers for -gen"),
    "write-lm": Option("string", None, "write the model"),
    "write-vocab": Option("string", None, "write all words"),
    "read-mix-lms": Option("flag", False, "-lm is a list of models to mix, with their weights"),
    **_refuse("mixture tables are not specified", context_priors="string"),
    "classes": Option("string", None, "what classes of words stand for"),
    "simple-classes": Option("flag", False, "each word is of one class at most, and classes stand for single words"),
    "expand-classes": Option("unsigned", None, "make a model of words, of n-grams of so many words at most (0: any)"),
    "expand-exact": Option("unsigned", 0, "compute exact probabilities of n-grams of so many words or more (0: none)"),
    **_refuse(
        "hidden-event models are not specified",
        hidden_vocab="string", hidden_not="flag", hiddens="string", df="flag", stop_words="string", hmm="flag",
    ),
    **_refuse(
        "maximum-entropy models are not specified", maxent="flag", mix_maxent="flag", maxent_convert_to_arpa="flag"
    ),
    **_refuse("factored models are not specified", factored="flag"),
    **_refuse(
        "tagged models are not specified", tagged="flag", decipher="flag", multiwords="flag", multi_char="string"
    ),
    "count-lm": Option("flag", False, "-lm is a count model"),
    **_refuse("models on servers are not specified", msweb_lm="string"),
    **_refuse(
        "servers are not specified",
        use_server="string", server_port="unsigned", server_maxclients="unsigned", cache_served_ngrams="flag",
    ),
    **_refuse("binary formats are not specified; use ARPA files", write_bin_lm="string", write_oldbin_lm="string"),
    **_refuse("quantised models are not specified", quantize="unsigned", codebook="string",
        write_codebook="string", write_with_codebook="flag"),
    **_refuse("skip n-gram models are not specified", skip="flag"),
    **_refuse("variance pruning is not specified", varprune="float"),
    **_refuse(
        "adaptation to marginals is not specified",
        adapt_marginals="string", base_marginals="string", adapt_marginals_beta="float", adapt_marginals_ratios="flag",
        dynamic="flag", dynamic_lambda="float", adapt_mix="flag", adapt_decay="float", adapt_iters="unsigned",
    ),
    **_refuse(
        "N-best lists are not specified",
        nbest="string", rescore="string", nbest_files="string", write_nbest_dir="string", max_nbest="unsigned",
        decipher_lm="string", decipher_order="unsigned", decipher_nounk="flag", decipher_lmw="float",
        decipher_nbest="string", decipher_nobackoff="flag",
        decipher_wtw="float", rescore_lmw="float", rescore_wtw="float", split_multiwords="flag", no_reorder="flag",
    ),
    **_refuse("its output is not specified", memuse="flag", nonull="flag"),
}  # fmt: skip

# With these options alone the model is only asked for probabilities. What other options need is loaded where they are
# met: most runs score, and a tool should start about as fast as numpy is imported.
_SCORING = {
    *("order", "debug", "lm", "vocab", "vocab-aliases", "nonevents", "limit-vocab", "unk", "map-unk", "tolower"),
    *("ppl", "no-sos", "no-eos", "reverse", "noise", "noise-vocab", "text-has-weights"),
    *("escape", "counts", "count-order", "float-counts", "write-vocab"),
}


@exit_status
def ngram(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Run `ngram` with these arguments; returns the exit status."""
    options = parse(tool, OPTIONS, arguments, streams)
    if options["map-unk"] and options["rescore-ngram"]:
        raise SrilmError("-map-unk goes not with -rescore-ngram: the n-grams to rescore have words of their own", 2)
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
        models = None
        if options["debug"] <= TOKENS and options.given <= _SCORING:
            debug, limited = options["debug"], options["limit-vocab"]
            tables = read_tables(
                options["lm"], self.words, self.streams, order=self.order, debug=debug, limited=limited
            )
            scorer: Scorer = Model(lambda: tables, self.words)
        else:
            from placerec.srilm.tools.ngram_models import Models

            models = Models(options, self.words, self.streams)
            scorer, self.words = models.scorer(), models.words
        handling = self.handling()
        printer = Printer(self.words, self.streams, options["debug"])
        if options["ppl"]:
            print_perplexity(options["ppl"], scorer, printer, handling)
        if options["counts"]:
            order = options["count-order"] or self.order
            walked = options["cache"] > 0 and options["debug"] < TOKENS
            counting = Counting(order, options["float-counts"], options["counts-entropy"], options["escape"], walked)
            print_counts(options["counts"], scorer, printer, counting)
        if options["gen"]:
            self.generate(scorer, handling)
        if models and options["write-lm"]:
            models.write(options["write-lm"])
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

    def handling(self) -> Handling:
        """What is done to the sentences of `-ppl`."""
        options = self.options
        noise = {self.words.add(PAUSE)}
        # What stands around a model does not know of its settings.
        if any(options[name] is not None for name in ("unk-prob", "zeroprob-word", "rescore-ngram")):
            return Handling(
                weight="first" if options["text-has-weights"] else "",
                bad_weight=BAD_WEIGHT,
                escape=options["escape"],
                verbose=options["debug"] >= 1,
                noise=frozenset(noise),
            )
        if options["noise"]:
            noise.add(self.words.add(options["noise"]))
        if options["noise-vocab"]:
            for line in self.streams.lines(options["noise-vocab"]):
                noise |= {self.words.add(word) for word in tokens(line)[:1]}
        if options["ppl"] and self.words.start in noise:
            raise SrilmError(f"{SENTENCE_START} cannot be left out of sentences; name other words as noise")
        return handling_of(
            options.values,
            bad_weight=BAD_WEIGHT,
            reverse=options["reverse"],
            escape=options["escape"],
            verbose=options["debug"] >= 1,
            noise=frozenset(noise),
        )

    def generate(self, scorer: Scorer, handling: Handling) -> None:
        """`-gen`: sentences drawn from the model, behind each prefix if there are some."""
        from placerec.srilm.tools.generation import Generator, drand48, print_sentences

        options = self.options
        seed = int.from_bytes(os.urandom(4), "big") if options["seed"] is None else options["seed"]
        generator = Generator(scorer, self.words, drand48(seed), self.streams, order=self.order, debug=options["debug"])
        prefixes = [*map(tokens, self.streams.lines(options["gen-prefixes"]))] if options["gen-prefixes"] else [[]]
        print_sentences(generator, options["gen"], prefixes, self.words.start if handling.start else None)
