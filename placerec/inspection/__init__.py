"""What a dictionary and a recognizer have learned, shown: words, one frame, how stable words are, one decision."""
