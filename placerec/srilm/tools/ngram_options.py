"""The options of `ngram`: what works, and what is refused because our SRILM specification does not say what it does."""

from placerec.srilm.tools.options import Option, Options


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
    "text-has-weights-last": Option("flag", False, "lines end with a weight"),
    "escape": Option("string", None, "the start of lines to copy"),
    "counts": Option("string", None, "the counts to score"),
    "count-order": Option("unsigned", 0, "largest n-gram length of -counts (0: -order)"),
    "counts-entropy": Option("flag", False, "weight -counts by joint probabilities"),
    "float-counts": Option("flag", False, "counts are real numbers"),
    "gen": Option("unsigned", 0, "this many sentences at random"),
    "gen-prefixes": Option("string", None, "starts of sentences for -gen"),
    "seed": Option("int", None, "of the random numbers for -gen (placerec's own, see docs/srilm.md)"),
    "write-lm": Option("string", None, "write the model"),
    "write-vocab": Option("string", None, "write all words"),
    **_refuse("mixture tables are not specified", read_mix_lms="flag", context_priors="string"),
    **_refuse(
        "class models are not specified",
        classes="string", expand_classes="unsigned", expand_exact="unsigned", simple_classes="flag",
    ),
    **_refuse(
        "hidden-event models are not specified",
        hidden_vocab="string", hidden_not="flag", hiddens="string", df="flag", stop_words="string",
    ),
    **_refuse(
        "maximum-entropy models are not specified", maxent="flag", mix_maxent="flag", maxent_convert_to_arpa="flag"
    ),
    **_refuse("factored models are not specified", factored="flag"),
    **_refuse(
        "tagged models are not specified", tagged="flag", decipher="flag", multiwords="flag", multi_char="string"
    ),
    **_refuse("count models are not specified", count_lm="flag", msweb_lm="string"),
    **_refuse(
        "servers are not specified",
        use_server="string", server_port="unsigned", server_maxclients="unsigned", cache_served_ngrams="flag",
    ),
    **_refuse(
        "binary formats are not specified; use ARPA files",
        write_bin_lm="string", write_oldbin_lm="string",
    ),
    **_refuse(
        "quantised models are not specified",
        quantize="unsigned", codebook="string",
    ),
    **_refuse("skip n-gram models are not specified", skip="flag"),
    **_refuse("variance pruning is not specified", varprune="float"),
    **_refuse(
        "adaptation to marginals is not specified",
        adapt_marginals="string", base_marginals="string", adapt_marginals_beta="float", adapt_marginals_ratios="flag",
        dynamic="flag", dynamic_lambda="float",
    ),
    **_refuse(
        "N-best lists are not specified",
        nbest="string", rescore="string", nbest_files="string", write_nbest_dir="string", max_nbest="unsigned",
        decipher_lm="string", decipher_order="unsigned", decipher_nounk="flag", decipher_lmw="float",
        decipher_wtw="float", rescore_lmw="float", rescore_wtw="float", split_multiwords="flag",
        no_reorder="flag",
    ),
    **_refuse("its output is not specified", memuse="flag"),
}  # fmt: skip
