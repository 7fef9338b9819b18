"""Pages in the browser: a drive is labelled, beliefs are watched; Python makes the data, and the page draws them."""
