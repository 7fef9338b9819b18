"""The words that are not words: where sentences begin and end, and whatever is not in the vocabulary."""

SENTENCE_START, SENTENCE_END, UNKNOWN = "<s>", "</s>", "<unk>"
