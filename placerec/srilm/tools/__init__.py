"""SRILM's commands: options, the order of work, and what is printed."""
