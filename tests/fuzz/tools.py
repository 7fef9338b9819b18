"""Files of SRILM's other tools: maps, classes, count models, events, outputs of `ngram -ppl`, and what scripts read."""

from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from tempfile import NamedTemporaryFile

import mutations
from harness import MODEL, fixed_model, run, same

from placerec.srilm.tools.add_ppls import add_ppls
from placerec.srilm.tools.batch_counts import make_batch_counts, merge_batch_counts
from placerec.srilm.tools.change_lm_vocab import change_lm_vocab
from placerec.srilm.tools.compute_best_mix import compute_best_mix
from placerec.srilm.tools.disambig import disambig
from placerec.srilm.tools.discount_scripts import (
    get_gt_counts,
    make_abs_discount,
    make_gt_discounts,
    make_kn_discounts,
)
from placerec.srilm.tools.hidden_ngram import hidden_ngram
from placerec.srilm.tools.lm_scripts import get_unigram_probs, make_sub_lm, reverse_lm, sort_lm
from placerec.srilm.tools.make_big_lm import make_big_lm
from placerec.srilm.tools.ngram import ngram
from placerec.srilm.tools.ngram_class import ngram_class
from placerec.srilm.tools.ngram_count import ngram_count
from placerec.srilm.tools.replace_words_with_classes import replace_words_with_classes
from placerec.srilm.tools.select_vocab import select_vocab
from placerec.srilm.tools.subtract_ppls import subtract_ppls
from placerec.srilm.tools.token_lines import compare_ppls, ppl_from_log
from placerec.srilm.tools.uniform_classes import uniform_classes

TEXT = b"a b c a\nb wwwwwwww\n\n\xc3\xa9 c b a </s>\n"
DECODING = ("-fb", "-posteriors", "-totals", "-nbest 3", "-continuous", "-keep-unk", "-logmap", "-lmw 0.5", "-fw-only")


def beside(path: Path, name: str, content: bytes) -> str:
    """A file beside the one that is tried."""
    other = path.with_name(name)
    other.write_bytes(content)
    return str(other)


def decoding(rng: Random) -> list[str]:
    """Some options of decoders."""
    return " ".join(rng.sample(DECODING, k=rng.randrange(3))).split()


def word_map(rng: Random) -> bytes:
    """What words may stand for."""
    lines = []
    for word in rng.sample(mutations.WORDS, k=rng.randrange(1, 8)):
        choices = [f"{v} {rng.random():.3g}" if rng.random() < 0.7 else v for v in rng.choices(mutations.WORDS, k=3)]
        lines.append(f"{word} {' '.join(choices)}\n")
    return "".join(lines).encode()


def check_map(path: Path, rng: Random) -> None:
    """A map that is written is read again as it was; texts and sequences of maps are decoded."""
    lm = [] if rng.random() < 0.2 else ["-lm", fixed_model(path)]
    match rng.randrange(3):
        case 0:
            first, again = (str(path.with_name(name)) for name in ("1.map", "2.map"))
            statuses = [run(disambig, "-map", a, "-write-map", b)[0] for a, b in ((path, first), (first, again))]
            if statuses == [0, 0]:
                same("maps written again", sorted(lines_of(first)), sorted(lines_of(again)))
        case 1:
            run(disambig, "-map", path, "-text", "-", *lm, *decoding(rng), stdin=TEXT)
        case 2:
            run(disambig, "-text-map", path, *lm, *decoding(rng))


def lines_of(name: str) -> list[bytes]:
    """The lines of a file."""
    return Path(name).read_bytes().splitlines()


def classes(rng: Random) -> bytes:
    """What classes stand for."""
    lines = []
    for _ in range(rng.randrange(1, 8)):
        p = f" {rng.random():.3g}" if rng.random() < 0.7 else ""
        words = " ".join(rng.choices(mutations.WORDS, k=rng.choice((1, 1, 1, 2, 3))))
        lines.append(f"{rng.choice(('A', 'B', 'a', 'LONG-CLASS'))}{p} {words}\n")
    return "".join(lines).encode()


def check_classes(path: Path, rng: Random) -> None:
    """Models over classes, and what else reads them."""
    lm = ["-lm", fixed_model(path), "-order", "2"]
    match rng.randrange(6):
        case 0:
            simple = rng.choice(([], ["-simple-classes"]))
            debug = str(rng.randrange(4))
            run(ngram, *lm, "-classes", path, *simple, "-ppl", "-", "-debug", debug, stdin=TEXT)
        case 1:
            length = str(rng.randrange(4))
            run(ngram, *lm, "-classes", path, "-expand-classes", length, "-write-lm", "-")
        case 2:
            kept = beside(path, "names", b"b\n")
            run(hidden_ngram, *lm, "-classes", path, "-text", "-", "-hidden-vocab", kept, *decoding(rng), stdin=TEXT)
        case 3:
            out = run(uniform_classes, path)[1]
            same("shares that are there stay", run(uniform_classes, stdin=out)[1], out)
        case 4:
            more = rng.choice(([], ["have_counts=1"], ["normalize=0"], ["addone=x"]))
            counted = f"outfile={path.with_name('out')}"
            run(replace_words_with_classes, f"classes={path}", counted, *more, "-", stdin=TEXT)
        case 5:
            run(ngram_class, "-read", path, "-text", "-", "-numclasses", "2", "-classes", "-", stdin=TEXT)


def count_model(rng: Random) -> bytes:
    """A Jelinek-Mercer model with its counts."""
    order, rows = rng.randrange(1, 4), rng.randrange(4)
    weights = [" " + " ".join(f"{rng.random():.3g}" for _ in range(order)) for _ in range(rows + 1)]
    lines = [f"order {order}", f"vocabsize {rng.randrange(20)}", f"totalcount {rng.randrange(40)}"]
    lines += [f"mixweights {rows}", *weights, f"countmodulus {rng.randrange(1, 3)}", "counts -"]
    return "\n".join([*lines, ""]).encode() + mutations.counts(rng)


def check_count_model(path: Path, rng: Random) -> None:
    """A model that is written is read again as it was; texts are scored, weights estimated."""
    order = ["-order", str(rng.randrange(1, 4))]
    match rng.randrange(3):
        case 0:
            first, again = path.with_name("1.lm"), path.with_name("2.lm")
            if run(ngram, "-count-lm", "-lm", path, *order, "-write-lm", first)[0] == 0:
                status = run(ngram, "-count-lm", "-lm", first, *order, "-write-lm", again)[0]
                same("what was written is read", status, 0)
                same("models written again", first.read_bytes(), again.read_bytes())
        case 1:
            run(ngram, "-count-lm", "-lm", path, *order, "-ppl", "-", "-debug", str(rng.randrange(5)), stdin=TEXT)
        case 2:
            out = path.with_name("out.lm")
            run(ngram_count, "-count-lm", "-init-lm", path, *order, "-text", "-", "-lm", out, stdin=TEXT)


def events(rng: Random) -> bytes:
    """Words with what may stand behind them."""
    lines = []
    for word in rng.choices(mutations.WORDS, k=rng.randrange(1, 8)):
        lines.append(f"{word} *noevent* {rng.random():.3g} b {rng.random():.3g} c\n")
    return "".join(lines).encode()


def check_events(path: Path, rng: Random) -> None:
    """Texts, sequences of maps, and lists of events."""
    lm = ["-lm", fixed_model(path), "-order", str(rng.randrange(1, 3))]
    vocabulary = ["-hidden-vocab", beside(path, "events", b"b\nc\n")]
    more = [*decoding(rng), *rng.choice(([], ["-force-event"], ["-write-counts", "-"]))]
    match rng.randrange(3):
        case 0:
            run(hidden_ngram, *lm, *vocabulary, "-text-map", path, *more)
        case 1:
            run(hidden_ngram, *lm, *vocabulary, "-text", path, *more)
        case 2:
            run(hidden_ngram, *lm, "-hidden-vocab", path, "-text", "-", *more, stdin=TEXT)


def check_classed(path: Path, rng: Random) -> None:
    """Words become classes; all words of the text that count are in one."""
    number = rng.choice(("0", "1", "2", "5", "99999"))
    if len(path.read_bytes()) > 1 << 14:
        # Thousands of words are no fault, and take their time.
        number = "0"
    more = rng.choice(([], ["-full"], ["-maxwordsperclass", "2"], ["-tolower"], ["-save", "1"]))
    if "-save" in more:
        more = ["-save", "1", "-save-maxclasses", "2"]
    written = ["-classes", str(path.with_name("c")), "-class-counts", str(path.with_name("n"))]
    run(ngram_class, rng.choice(("-text", "-counts")), path, "-numclasses", number, *more, *written)


def scored(rng: Random) -> bytes:
    """What `ngram -debug 2 -ppl` prints."""
    text = mutations.text(rng)
    options = rng.choice(([], ["-unk"], ["-no-sos"]))
    # The model stands on standard input, and the text in a file of the system's: none of the case's own.
    with NamedTemporaryFile() as file:
        file.write(text)
        file.flush()
        return run(ngram, "-lm", "-", "-ppl", file.name, "-debug", "2", *options, stdin=MODEL)[1]


def check_scored(path: Path, rng: Random) -> None:
    """Totals, differences and mixtures of outputs."""
    other = beside(path, "other", path.read_bytes())
    match rng.randrange(5):
        case 0:
            out = run(ppl_from_log, path)[1]
            same("tokens twice", run(ppl_from_log, path, other)[0], run(ppl_from_log, path)[0])
            same("output is there", bool(out), run(ppl_from_log, path)[0] == 0)
        case 1:
            status, out, _ = run(compare_ppls, path, other)
            if status == 0:
                same(
                    "an output differs from itself", out.partition(b"equal ")[2].split(b",")[0], out.split(b",")[0][6:]
                )
        case 2:
            run(add_ppls, path, other)
        case 3:
            run(subtract_ppls, path, other)
        case 4:
            run(compute_best_mix, path, other)


SCRIPTS: dict[str, Callable[[Random], bytes]] = {
    "arpa": mutations.arpa,
    "counts": mutations.counts,
    "text": mutations.text,
}


def any_of_scripts(rng: Random) -> bytes:
    """A model, counts or a text."""
    return rng.choice(list(SCRIPTS.values()))(rng)


def check_scripts(path: Path, rng: Random) -> None:
    """Scripts that read models, counts, texts and lists."""
    held = beside(path, "held", TEXT)
    folder = str(path.with_name("counts"))
    listed = beside(path, "list", f"{path}\n{path}\n".encode())
    runs: Sequence[Callable[[], object]] = (
        lambda: same("sorted again", run(sort_lm, stdin=(out := run(sort_lm, path))[1])[1], out[1]),
        lambda: run(make_sub_lm, "maxorder=1", path),
        lambda: run(get_unigram_probs, "linear=1", path),
        lambda: run(reverse_lm, path),
        lambda: run(change_lm_vocab, "-vocab", held, "-lm", path),
        lambda: run(select_vocab, "-heldout", held, path, path),
        lambda: run(select_vocab, "-heldout", path, held),
        lambda: run(get_gt_counts, f"out={path}", path),
        lambda: run(rng.choice((make_gt_discounts, make_kn_discounts, make_abs_discount)), path),
        lambda: run(make_big_lm, "-name", path.with_name("aux"), "-read", path, "-lm", path.with_name("big.lm")),
        lambda: run(ngram, "-lm", path, "-read-mix-lms", "-ppl", held),
        lambda: run(ngram, "-lm", beside(path, "mix", f"{path} -weight 1\n".encode()), "-read-mix-lms", "-ppl", held),
        lambda: run(make_batch_counts, path, "2", "cat", folder),
        lambda: (run(make_batch_counts, listed, "1", "cat", folder), run(merge_batch_counts, folder)),
        lambda: run(merge_batch_counts, folder, listed),
    )
    rng.choice(runs)()
