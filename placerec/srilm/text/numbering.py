"""The numbers that SRILM gives to the words of a text, many words at once."""

import numpy as np

from placerec.arrays import Ints
from placerec.srilm.text.fields import Fields, NameTable
from placerec.srilm.text.vocabulary import WordList

_MANY = 1000


class Numbering:
    """Numbers the words of a text or counts file, many at a time; `adding`: new ones are added to `words`."""

    def __init__(self, words: WordList, adding: bool) -> None:
        self.words, self.adding = words, adding
        self.names = NameTable(words.index)
        self.asked = 0

    def numbers(self, fields: Fields, at: Ints | None = None) -> Ints:
        """The numbers of the words in all fields, or `at` some (T,); new ones are added in order of occurrence."""
        numbers = self.names.find(fields, slice(None) if at is None else at)
        missing = np.flatnonzero(numbers < 0)
        if not len(missing):
            return numbers
        if not self.adding or (self.words.closed and self.words.meta_tag is None):
            numbers[missing] = self.words.index[self.words.unknown]
            self.words.missed += len(missing)
            return numbers
        at = np.arange(len(numbers)) if at is None else at
        while len(missing):
            now, missing = np.split(missing, [max(_MANY, self.names.size // 2)])
            numbers[now] = [self.words.number(fields.text(i).decode("latin-1")) for i in at[now].tolist()]
            self.asked += len(now)
            # Asking one by one has taken about as long as a new table takes.
            if self.asked > self.names.size // 2:
                self.names, self.asked = NameTable(self.words.index), 0
                numbers[missing] = self.names.find(fields, at[missing])
                missing = missing[numbers[missing] < 0]
        return numbers
