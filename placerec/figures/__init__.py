"""What is drawn: the parts of pictures and pages, and the picture of an evaluation."""
