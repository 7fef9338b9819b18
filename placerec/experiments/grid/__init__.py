"""The paper's experiment, on any recordings: a grid of cells, its figure, its tables and its claims."""
