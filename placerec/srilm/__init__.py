"""SRILM's commands over placerec.lm: the option parser, the files, the messages and the order of work."""
