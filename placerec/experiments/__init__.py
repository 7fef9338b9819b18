"""Whole experiments: the paper's grid (`grid`), and every method on the same recordings (`comparison`)."""
