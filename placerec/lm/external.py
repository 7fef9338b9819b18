"""KenLM as an independent scorer: optional, never the trainer."""

import re
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from placerec.arrays import Floats
from placerec.errors import LanguageModelError, check_optional
from placerec.files import read_text
from placerec.lm.arpa import read_arpa

KENLM_MAX_ORDER = 6
KENLM_PURPOSE = "scoring with KenLM"
Scorer = Callable[[Sequence[str]], Floats]


def kenlm_scorer(path: Path | str) -> Scorer:
    """A function that gives KenLM's log10 p float64 (T,) of T words: empty first context, no markers.

    Order 1, which KenLM refuses, is loaded through a temporary copy that is padded with one bigram. Raises
    MissingExtraError if KenLM is not installed, LanguageModelError for a file that it cannot load.
    """
    check_optional("kenlm", KENLM_PURPOSE)
    import kenlm

    config = kenlm.Config()
    config.show_progress = False
    config.arpa_complain = kenlm.ARPALoadComplain.NONE
    order = read_arpa(path).order
    if order > KENLM_MAX_ORDER:
        raise LanguageModelError(
            f"{path}: order {order}; KenLM scores orders up to {KENLM_MAX_ORDER}; use the native scorer"
        )
    with tempfile.TemporaryDirectory() as folder:
        loadable = Path(path)
        if order == 1:
            loadable = Path(folder) / "padded.arpa"
            loadable.write_text(_padded(read_text(Path(path), LanguageModelError)), encoding="utf-8")
        try:
            model = kenlm.Model(str(loadable), config)
        except OSError as error:
            raise LanguageModelError(f"{path}: KenLM cannot load it: {str(error).splitlines()[0]}") from error

    def score(words: Sequence[str]) -> Floats:
        return np.array([p for p, _, _ in model.full_scores(" ".join(words), bos=False, eos=False)], np.float64)

    return score


def _padded(text: str) -> str:
    """A unigram ARPA text with a bigram that no stream without markers ever asks for."""
    text = re.sub(r"^(ngram\s+1\s*=.*)$", r"\1\nngram 2=1", text, count=1, flags=re.MULTILINE)
    head, _, _ = text.partition("\\end\\")
    return f"{head}\\2-grams:\n-99\t<s> </s>\n\n\\end\\\n"
