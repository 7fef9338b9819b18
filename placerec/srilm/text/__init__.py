"""What the commands read and write line by line: streams, running text, word lists and counts files."""
