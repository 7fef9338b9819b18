"""The synthetic laboratory: image sequences of rooms that exist nowhere, in COLD's layout."""
