"""Language models as SRILM reads, mixes and scores them."""
