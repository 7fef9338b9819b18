"""Which word comes next: python docs/examples/next_words.py TEXT [WORD...]; TEXT has a sentence a line."""

import sys
from pathlib import Path

import placerec

text, *history = sys.argv[1:]
model = placerec.train_ngrams(text, order=3, smoothing="witten-bell")
placerec.write_arpa(model, Path(text).with_suffix(".arpa"))
for word, log10_p in model.next_words(history, k=5):
    print(f"{10**log10_p:.4f}  {' '.join([*history, word])}")
