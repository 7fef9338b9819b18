"""`ngram-count`: text and counts in, counts, vocabularies and language models out (sections 2 to 7)."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from placerec.lm.counts import NgramCounts, add_counts, count_text, format_counts, recomputed
from placerec.lm.discounts import Rule
from placerec.lm.estimation import estimate_mutable
from placerec.lm.mutable import insert_prefixes
from placerec.lm.prune import prune
from placerec.lm.stored_text import StoredText
from placerec.srilm.model.arpa import write_model
from placerec.srilm.order.counts import EstimationMessages, FirstSeen
from placerec.srilm.text.counts_file import MOST, TOO_MANY, parse_count
from placerec.srilm.text.counts_table import Table, read_counts
from placerec.srilm.text.sentences import handling_of, mark, read_sentences
from placerec.srilm.text.streams import SrilmError, Streams, exit_status
from placerec.srilm.text.vocabulary import WordList, format_indices, format_words, read_aliases, read_words
from placerec.srilm.tools.discounting import MODIFYING, Fitter, choose, given_method, truncated
from placerec.srilm.tools.options import Option, Options, Parsed, parse

TOOL = "ngram-count"


def _method_options() -> dict[str, Option]:
    options: dict[str, Option] = {}
    for suffix in ("", *map(str, range(1, 10))):
        which = f"order {suffix}" if suffix else "all orders"
        options["ndiscount" + suffix] = Option("flag", False, f"natural discounting, {which}")
        options["wbdiscount" + suffix] = Option("flag", False, f"Witten-Bell discounting, {which}")
        options["cdiscount" + suffix] = Option("float", -1.0, f"absolute discounting by this much, {which}")
        options["addsmooth" + suffix] = Option("float", -1.0, f"add this much to counts, {which}")
        options["ukndiscount" + suffix] = Option("flag", False, f"original Kneser-Ney discounting, {which}")
        options["kndiscount" + suffix] = Option("flag", False, f"modified Kneser-Ney discounting, {which}")
        options["kn" + suffix] = Option("string", None, f"Kneser-Ney parameter file, {which}")
        options["gt" + suffix] = Option("string", None, f"Good-Turing parameter file, {which}")
        options["interpolate" + suffix] = Option("flag", False, f"interpolate with the shorter context, {which}")
        higher = suffix or "above 9"
        low = 2.0 if suffix and int(suffix) > 2 else 1.0
        top = {"": 5, "1": 1}.get(suffix, 7)
        options[f"gt{suffix}min"] = Option("float", low, f"leave out n-grams seen less often, order {higher}")
        options[f"gt{suffix}max"] = Option("int", top, f"largest count that Good-Turing discounts, order {higher}")
        if suffix:
            options["write" + suffix] = Option("string", None, f"write the counts of {which}")
    return options


OPTIONS: Options = {
    "order": Option("unsigned", 3, "largest n-gram length"),
    "debug": Option("int", 0, "how much to say"),
    "text": Option("string", None, "text to count"),
    "text-has-weights": Option("flag", False, "lines begin with a weight"),
    "text-has-weights-last": Option("flag", False, "lines end with a weight"),
    "no-sos": Option("flag", False, "do not put <s> in front of lines"),
    "no-eos": Option("flag", False, "do not put </s> behind lines"),
    "read": Option("string", None, "counts to read"),
    "intersect": Option("string", None, "count only the n-grams of this counts file"),
    "read-with-mincounts": Option("flag", False, "apply minimum counts while reading"),
    "float-counts": Option("flag", False, "counts are real numbers"),
    "recompute": Option("flag", False, "make shorter counts from longer ones"),
    "meta-tag": Option("string", None, "words with this start are counts of counts"),
    "trust-totals": Option("flag", False, "take contexts' counts for their totals"),
    "vocab": Option("string", None, "the words; others become <unk>"),
    "vocab-aliases": Option("string", None, "other names of words"),
    "nonevents": Option("string", None, "words that are never predicted"),
    "limit-vocab": Option("flag", False, "leave out n-grams with other words while reading counts"),
    "unk": Option("flag", False, "<unk> is a word like others"),
    "map-unk": Option("string", None, "the word to use for <unk>"),
    "tolower": Option("flag", False, "A to Z become a to z"),
    "lm": Option("string", None, "write a language model"),
    "write": Option("string", None, "write counts"),
    "write-order": Option("unsigned", 0, "length of the n-grams that -write writes (0: all)"),
    "sort": Option("flag", False, "sort what is written"),
    "write-vocab": Option("string", None, "write all words"),
    "write-vocab-index": Option("string", None, "write all words with their numbers"),
    "write-text": Option("string", None, "copy the text instead of counting it"),
    "prune": Option("float", 0.0, "leave out n-grams that change perplexity by less"),
    "minprune": Option("unsigned", 2, "shortest n-grams to prune"),
    "kn-counts-modified": Option("flag", False, "the counts are Kneser-Ney's already"),
    "kn-modify-counts-at-end": Option("flag", False, "change counts after the discounts are estimated"),
    **_method_options(),
    "count-lm": Option("flag", False, "estimate the weights of a count model"),
    "init-lm": Option("string", None, "the count model to begin with"),
    "em-iters": Option("unsigned", 100, "so many steps at most for -count-lm"),
    "em-delta": Option("float", 0.001, "the change in log likelihood at which -count-lm ends"),
    "maxent": Option("flag", False, "maximum-entropy models (refused, as by SRILM built without liblbfgs)"),
    "read-google": Option("string", None, "counts in Google's folders are not specified", refused=True),
    "skip": Option("flag", False, "skip n-gram models are not specified", refused=True),
    "varprune": Option("float", 0.0, "variance pruning is not specified", refused=True),
    "skip-init": Option("float", 0.5, "skip n-gram models are not specified", refused=True),
    "stop-words": Option("string", None, "stop-word models are not specified", refused=True),
    "tag": Option("flag", False, "tagged models are not specified", refused=True),
    "tagged": Option("flag", False, "tagged models are not specified", refused=True),
    "memuse": Option("flag", False, "its output is not specified", refused=True),
    "write-binary": Option("string", None, "binary formats are not specified; use -write", refused=True),
    "write-binary-lm": Option("flag", False, "binary formats are not specified; use ARPA files", refused=True),
}


@exit_status
def ngram_count(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Run `ngram-count` with these arguments; returns the exit status."""
    # Real counts may be infinite: what comes of them is printed as it is.
    with np.errstate(all="ignore"):
        _run(parse(tool, OPTIONS, arguments, streams), streams)
    return 0


def _run(options: Parsed, streams: Streams) -> None:
    if options["maxent"]:
        raise SrilmError("maxent model estimation not supported (requires liblbfgs)", 2)
    if given_method(options, "")[1] > 1:
        raise SrilmError("conflicting default discounting options", 2)
    words = read_vocabulary(options, streams)
    counts, first = read_all(options, words, streams)
    if options["order"] < 1:
        streams.say("LM order must be positive -- set to 1")
    if options["count-lm"] and options["lm"] is not None:
        # Not needed by those who count.
        from placerec.srilm.tools.count_lm import write_count_model

        write_count_model(options, counts, words, first, streams)
        _write_rest(options, counts, words, first, streams)
        return
    vocabulary = counts.trie.vocabulary
    meta = np.array([words.occurrences(word) for word in vocabulary.words], np.int64)
    predictable = ~vocabulary.mask(words.non_events) & (meta < 0)
    fitter = Fitter(counts, predictable, meta, options, streams, options["debug"], options["float-counts"])
    rules = []
    wanted = options["lm"] is not None
    for n in range(1, max(1, options["order"]) + 1):
        choice = choose(options, n, model_wanted=wanted)
        rules.append(fitter.rule(n, choice, read=wanted) if choice else Rule())
    if wanted:
        _write_model(options, fitter, rules, words, first, streams)
    _write_rest(options, fitter.counts, words, first, streams)


def read_vocabulary(options: Parsed, streams: Streams) -> WordList:
    """The words that the options name."""
    words = WordList(lower=options["tolower"], open_unknown=options["unk"], meta_tag=options["meta-tag"])
    if options["map-unk"]:
        words.map_unknown(options["map-unk"])
    if options["vocab"]:
        read_words(words, options["vocab"], streams)
        words.closed = True
    if options["vocab-aliases"]:
        read_aliases(words, options["vocab-aliases"], streams)
    if options["nonevents"]:
        read_words(words, options["nonevents"], streams, silent=True)
    return words


def read_all(options: Parsed, words: WordList, streams: Streams) -> tuple[NgramCounts, FirstSeen]:
    """All counts, and what tells the order in which n-grams were first seen."""
    order, fractional = options["order"], options["float-counts"]
    limited = options["limit-vocab"]
    tables: list[Table] = []
    only = None
    if options["intersect"]:
        only = read_counts(options["intersect"], order, words, streams, fractional=fractional, limited=limited)
        tables.append(only.emptied())
    if options["read"]:
        minima = None
        if options["read-with-mincounts"]:
            minima = [truncated(options[f"gt{n}min"]) for n in (*range(1, 10), "")]
        table = read_counts(
            options["read"], order, words, streams, fractional=fractional, limited=limited, minima=minima
        )
        tables.append(table.within(only) if only else table)
    text = None
    if options["text"] and options["write-text"]:
        lines = streams.lines(options["text"])
        with streams.output(options["write-text"]) as file:
            file.writelines((line + lines.end).encode("latin-1") for line in lines)
    elif options["text"]:
        text = _read_text(options, words, streams)
    counts = _tabulated(order, tables, text, words, fractional=fractional)
    if not fractional and _total(tables, text) > MOST:
        # Sums that were too large differ from those of real numbers.
        real = _tabulated(order, tables, text, words, fractional=True)
        if any((np.abs(a - b) > 2.0**62).any() for a, b in zip(counts.counts, real.counts, strict=True)):
            raise SrilmError(TOO_MANY.format("a sum of counts"))
    if options["recompute"]:
        counts = recomputed(counts)
    return counts, FirstSeen(tables, text, words)


def _tabulated(
    order: int, tables: Sequence[Table], text: StoredText | None, words: WordList, *, fractional: bool
) -> NgramCounts:
    parts = [table.count(max(1, order), words, fractional=fractional) for table in tables]
    if text is not None and order > 0:
        vocabulary, sorted_number = words.sorted()
        parts.append(count_text(text, order, vocabulary, renumbered=sorted_number, fractional=fractional))
    if not parts:
        parts.append(Table().count(max(1, order), words, fractional=fractional))
    return parts[0] if len(parts) == 1 else add_counts(*parts)


def _total(tables: Sequence[Table], text: StoredText | None) -> float:
    blocks = text if text is not None and text.weighted else ()
    weights = (block.weights.astype(np.float64) @ block.lengths for block in blocks if block.weights is not None)
    return float(sum(table.total for table in tables) + sum(weights))


def _read_text(options: Parsed, words: WordList, streams: Streams) -> StoredText:
    """The sentences of `-text` between markers, as SRILM's word numbers; with -debug 1, tells how many there are."""
    parse_weight = partial(parse_count, fractional=options["float-counts"])
    handling = handling_of(options.values, adding=True, parse_weight=parse_weight, too_long="line too long?")
    text = StoredText()
    lines = streams.lines(options["text"])
    sentences = found = 0
    words.missed = 0
    for part in read_sentences(lines, words, handling):
        marked = mark(part, words, handling)
        sentences += len(part.lengths)
        found += int((marked.lengths - marked.opened - marked.ended).sum())
        if len(part.lengths):
            text.add(marked.numbers, marked.lengths, part.weights if handling.weight else None)
    if options["debug"] >= 1:
        streams.say(f"{lines.position}{sentences} sentences, {found} words, {words.missed} OOVs")
        if found + sentences > 0:
            streams.say("0 zeroprobs, logprob= 0 ppl= 1 ppl1= " + ("1" if found > words.missed else "undefined"))
    return text


def _write_model(
    options: Parsed, fitter: Fitter, rules: Sequence[Rule], words: WordList, first: FirstSeen, streams: Streams
) -> None:
    announced = {n: MODIFYING.format(n) for n in fitter.late if fitter.prepare(n, silent=True)}
    trace = EstimationMessages(fitter.counts, first, streams, options["debug"], announced=announced)
    mutable = estimate_mutable(
        fitter.counts,
        rules,
        non_events=words.non_events,
        open_vocabulary=words.open_unknown,
        unknown=words.unknown,
        meta=fitter.meta,
        trust_totals=options["trust-totals"],
        alias_counts=np.array(words.names(fitter.counts.trie.vocabulary), np.int64),
        trace=trace,
    )
    insert_prefixes(mutable, trace)
    if options["prune"] > 0:
        prune(mutable, options["prune"], shortest=options["minprune"], trace=trace)
    write_model(mutable, options["lm"], streams, options["debug"])


def _write_rest(options: Parsed, counts: NgramCounts, words: WordList, first: FirstSeen, streams: Streams) -> None:
    """Vocabularies and counts, in SRILM's order; counts on standard output if nothing else is written."""
    formatted = partial(format_counts if options["sort"] else first.format, counts)
    show = partial(formatted, count="%.16g" if options["float-counts"] else "%d")
    if options["write-vocab"]:
        streams.write(options["write-vocab"], format_words(words))
    if options["write-vocab-index"]:
        streams.write(options["write-vocab-index"], format_indices(words))
    orders = [n for n in range(1, 10) if options[f"write{n}"]]
    for n in orders:
        streams.write(options[f"write{n}"], show(only=n) if n <= counts.order else "")
    orders_used = [str(n) for n in range(1, min(9, max(1, options["order"])) + 1)]
    files = [name for name in options.given if name.startswith(("kn", "gt")) and name[2:] in ("", *orders_used)]
    silent = orders or files or any(options[name] for name in ("lm", "write-vocab", "write-vocab-index", "write-text"))
    target = options["write"] or (None if silent else "-")
    if target:
        only = options["write-order"] or None
        streams.write(target, show(only=only) if only is None or only <= counts.order else "")
