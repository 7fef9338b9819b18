"""`ngram-class`: word classes from the bigrams of a text; section T2 of our specification of SRILM's tools."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from placerec.arrays import Ints
from placerec.errors import LanguageModelError
from placerec.lm.classes import ClassBigrams, Merger
from placerec.lm.counts import format_counts, tabulate
from placerec.lm.perplexity import Totals
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, Vocabulary
from placerec.srilm.order.class_sums import printed_cost, printed_log_likelihood
from placerec.srilm.order.hashing import table_order
from placerec.srilm.text.classes_file import split_expansion
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools import ngram_count
from placerec.srilm.tools.options import Option, Options, Parsed, parse
from placerec.srilm.tools.reports import Printer

TOOL = "ngram-class"
OPTIONS: Options = {
    "debug": Option("int", 0, "how much to say"),
    "vocab": Option("string", None, "the words; others become <unk>"),
    "tolower": Option("flag", False, "A to Z become a to z"),
    "noclass-vocab": Option("string", None, "words to leave out of classes (default: <s> and </s>)"),
    "counts": Option("string", None, "counts to read"),
    "text": Option("string", None, "text to count"),
    "numclasses": Option("unsigned", 1, "how many classes to make (0: do not merge)"),
    "full": Option("flag", False, "merge the best pair of all classes"),
    "incremental": Option("flag", False, "merge the best pair of the most frequent classes (default)"),
    "maxwordsperclass": Option("unsigned", 0, "a class of so many words takes no more (0: no limit)"),
    "interact": Option("flag", False, "merging by hand is not specified", refused=True),
    "read": Option("string", None, "classes to start from"),
    "class-counts": Option("string", None, "write the counts of the classes"),
    "classes": Option("string", None, "write the classes"),
    "save": Option("unsigned", 0, "write both after every so many mergers"),
    "save-maxclasses": Option("unsigned", 0, "begin to write them when so many classes are left"),
}
_DETAILS = 2
# Counts beyond this do not fit into double precision.
_MOST = 2**53


@exit_status
def ngram_class(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Run `ngram-class` with these arguments; returns the exit status."""
    options = parse(tool, OPTIONS, arguments, streams)
    if options["text"] is None and options["counts"] is None:
        raise SrilmError("Specify counts or text file as input.")
    words = ngram_count.read_vocabulary(_counting(options), streams)
    run = _Run(options, words, streams)
    run.count()
    run.initialise()
    run.merge()
    run.finish()
    return 0


def _counting(options: Parsed) -> Parsed:
    """The options of `ngram-count` that count the words and word pairs that are to be classed."""
    values = {name: option.default for name, option in ngram_count.OPTIONS.items()}
    shared = {name: options[name] for name in ("debug", "vocab", "tolower", "text")}
    return Parsed(values | shared | {"order": 2, "read": options["counts"]})


class _Run:
    """One run: the words' counts, the classes by name in byte order, and what merges them."""

    def __init__(self, options: Parsed, words: WordList, streams: Streams) -> None:
        self.options, self.words, self.streams = options, words, streams
        self.debug = options["debug"]
        self.iteration = 0
        self.merger: Merger | None = None

    def say(self, message: str) -> None:
        if self.debug >= _DETAILS:
            self.streams.say(message)

    def count(self) -> None:
        """Count words and word pairs: the text's first, whose words are numbered first."""
        tables = []
        for name in ("text", "read"):
            options = _counting(self.options)
            if options[name] is not None:
                options.values["text" if name == "read" else "read"] = None
                tables.append(ngram_count.read_all(options, self.words, self.streams)[0])
        if sum(float(np.abs(counts).sum(dtype=np.float64)) for table in tables for counts in table.counts) >= _MOST:
            raise SrilmError(f"counts add up to more than {_MOST}, the largest sum that ngram-class can work with")
        vocabulary, _ = self.words.sorted()
        unigrams = np.zeros(len(vocabulary), np.int64)
        pairs: list[tuple[Ints, Ints, Ints]] = []
        for table in tables:
            number = vocabulary.ids(table.trie.vocabulary.words)
            np.add.at(unigrams, number, table.counts[0])
            rows = np.flatnonzero(table.counts[1])
            pairs.append((number[table.trie.prefix(2)[rows]], number[table.trie.word(2)[rows]], table.counts[1][rows]))
        left, right, count = (np.concatenate(column) for column in zip(*pairs, strict=True))
        self.vocabulary, self.counted = vocabulary, ClassBigrams(unigrams, left, right, count)

    def initialise(self) -> None:
        """Put each word into the class that -read says, or into one of its own (section T2.2)."""
        listed, counts = self.vocabulary.words, self.counted.unigrams
        excluded = self.excluded()
        class_of = dict(self.read())
        made = dict.fromkeys(class_of.values())
        number = 0
        self.seen = [i for i in range(len(listed)) if counts[i] > 0]
        for word in sorted((listed[i] for i in self.seen), key=lambda word: (word != self.words.unknown, word)):
            if word in class_of or word in excluded:
                continue
            name = ""
            while not name or name in made:
                number += 1
                name = self.words.normal(f"CLASS-{number:05d}")
            made[name] = None
            class_of[word] = name
            self.say(f"\tcreating {name} for word {word}")
        named = [class_of.get(word, word) for word in listed]
        self.names = sorted({*made, *named})
        place = {name: i for i, name in enumerate(self.names)}
        # In the order in which they were made: that orders those that are equally frequent.
        self.made = [place[name] for name in made]
        # Words that are no classes come first where sums are formed.
        self.order = np.array(sorted(range(len(place)), key=lambda i: self.names[i] in made), np.int64)
        self.target = np.array([place[name] for name in named], np.int64)
        self.classes = self.counted.merged(self.target, len(self.names))

    def excluded(self) -> set[str]:
        """The words that are not put into classes."""
        name = self.options["noclass-vocab"]
        if not name:
            return {self.words.normal(SENTENCE_START), self.words.normal(SENTENCE_END)}
        return {self.words.normal(found[0]) for line in self.streams.lines(name) if (found := tokens(line))}

    def read(self) -> Iterator[tuple[str, str]]:
        """The words of -read, and the class of each."""
        if not self.options["read"]:
            return
        lines = self.streams.lines(self.options["read"])
        for line in lines:
            name, p, words = split_expansion([self.words.normal(word) for word in tokens(line)])
            if p is None or len(words) != 1:
                raise SrilmError(f"{lines.position}malformed class expansion", 2)
            self.say(f"\tassigning word {words[0]} to class {name}")
            yield words[0], name

    def merge(self) -> None:
        """Merge classes until as many are left as -numclasses says (section T2.4)."""
        wanted, self.left = self.options["numclasses"], len(self.made)
        self.tell()
        if not wanted:
            return
        full = self.options["full"] and not self.options["incremental"]
        if wanted >= len(self.made):
            if not full:
                for number in self.by_falling_count():
                    self.say(f"\tadding {self.names[number]}")
            return
        try:
            merger = self.merger = Merger(self.classes, len(self.made) if full else wanted + 1)
        except LanguageModelError as error:
            raise SrilmError(f"{TOOL}: -numclasses {wanted}: {error}") from error
        if full:
            for number in self.made:
                merger.add(number)
            while self.left > wanted:
                self.merge_best(merger)
        else:
            self.merge_frequent(merger, wanted)

    def by_falling_count(self) -> list[int]:
        """The classes from the most frequent to the rarest; of equal ones, that made last first."""
        counts = self.classes.unigrams[self.made]
        return [self.made[i] for i in np.lexsort((-np.arange(len(counts)), -counts)).tolist()]

    def merge_frequent(self, merger: Merger, wanted: int) -> None:
        """Merge among the `wanted` + 1 most frequent classes, taking up the next one after each merger."""
        waiting = self.by_falling_count()
        most = self.options["maxwordsperclass"]
        size = np.bincount(self.target[self.seen], minlength=len(self.names))
        for number in waiting[:wanted]:
            self.take_up(merger, number)
        waiting = waiting[wanted:]
        while waiting:
            while waiting and len(merger.active) <= wanted:
                self.take_up(merger, waiting.pop(0))
            if len(merger.active) <= wanted:
                return
            kept, gone = self.merge_best(merger)
            size[kept] += size[gone]
            if waiting and most and size[kept] >= most:
                self.say(f"\tclass {self.names[kept]} now contains {size[kept]} words")
                merger.remove(kept)

    def take_up(self, merger: Merger, number: int) -> None:
        """Make a class a candidate."""
        self.say(f"\tadding {self.names[number]}")
        merger.add(number)

    def merge_best(self, merger: Merger) -> tuple[int, int]:
        """Merge the best pair of candidates; the class that is kept, and the other one."""
        kept, gone = merger.best()
        if self.debug >= _DETAILS:
            cost = printed_cost(merger, kept, gone, self.order)
            self.say(f"\tmerging {self.names[kept]} and {self.names[gone]} diff = {cost:g}")
        merger.merge(kept, gone)
        self.iteration += 1
        self.left -= 1
        self.tell()
        self.save()
        return kept, gone

    def tell(self) -> None:
        """Say how many classes there are."""
        if self.debug >= _DETAILS:
            shown = "-nan"
            if self.predicted > 0:
                # The mean is rounded to float32, too.
                ppl = Totals(words=1, log10_p=float(np.float32(self.log10_p / self.predicted))).ppl
                shown = f"{ppl:g}"
            self.say(f"iter {self.iteration}: {self.left} classes, perplexity = {shown}")

    @property
    def log10_p(self) -> float:
        """The log-likelihood of the classes as they are now."""
        classes = self.classes.merged(self.merged(), len(self.names))
        return printed_log_likelihood(self.counted.unigrams, classes, self.order)

    @property
    def predicted(self) -> int:
        """How many words there are, sentence starts aside."""
        return int(self.counted.unigrams.sum()) - self.occurrences(SENTENCE_START)

    def occurrences(self, word: str) -> int:
        number = self.vocabulary.index.get(word)
        return 0 if number is None else int(self.counted.unigrams[number])

    def save(self) -> None:
        """Write what there is after every -save mergers."""
        every, most = self.options["save"], self.options["save-maxclasses"]
        if not every or (most and self.left > most):
            return
        number = self.iteration - max(0, len(self.made) - most) if most else self.iteration
        if number % every == 0:
            self.write(f".{number:06d}")

    def finish(self) -> None:
        """Say how well the classes predict the words, and write them."""
        if self.debug >= 1:
            sentences = self.occurrences(SENTENCE_END)
            totals = Totals(sentences=sentences, words=self.predicted - sentences, log10_p=self.log10_p)
            self.streams.say(Printer(self.words, self.streams, 0).block(totals, None).removesuffix("\n"))
        self.write("")

    def merged(self) -> Ints:
        """What class each class of the beginning has become."""
        return np.arange(len(self.names)) if self.merger is None else self.merger.target

    def write(self, suffix: str) -> None:
        """`-classes` and `-class-counts` (section T2.5)."""
        if self.options["classes"]:
            self.streams.write(self.options["classes"] + suffix, self.format_classes())
        if self.options["class-counts"]:
            self.streams.write(self.options["class-counts"] + suffix, self.format_counts())

    def format_classes(self) -> str:
        """Lines `CLASS P word`, the words of a class in the order of SRILM's tables."""
        listed, counts = self.vocabulary, self.counted.unigrams
        seen = np.array(self.seen, np.int64)
        keys = self.words.numbers(listed)[seen].astype(np.uint64)
        walked = table_order(np.zeros(len(seen), np.int64), keys)
        target = self.merged()[self.target[seen[walked]]]
        walked = walked[np.isin(target, self.merged()[self.made])]
        target = self.merged()[self.target[seen[walked]]]
        by_class = np.argsort(target, kind="stable")
        _, table = np.unique(target[by_class], return_inverse=True)
        walked = walked[by_class]
        ordered = walked[table_order(table, keys[walked])]
        total = np.bincount(target[by_class], weights=counts[seen[walked]], minlength=len(self.names))
        return "".join(
            f"{self.names[i]} {counts[word] / total[i]:.16g} {listed.words[word]}\n"
            for i, word in zip(np.sort(target).tolist(), seen[ordered].tolist(), strict=True)
        )

    def format_counts(self) -> str:
        """A sorted counts file of the classes' n-grams; what does not occur is left out."""
        classes = self.classes.merged(self.merged(), len(self.names))
        some = np.flatnonzero(classes.unigrams)
        names = Vocabulary.of(self.names)
        pairs = np.stack([classes.left, classes.right], axis=1)
        table = tabulate(names, 2, [some[:, None], pairs], [classes.unigrams[some], classes.count])
        # A pair may occur though its first class, by the counts of words, does not.
        return format_counts(replace(table, seen=tuple(counts > 0 for counts in table.counts)))
