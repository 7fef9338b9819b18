"""What exists only for the order of SRILM's output and messages, which is that of its hash tables.

Nothing here changes a number: without it, unsorted counts and messages would come in another order than SRILM's.
"""
