"""The synthetic laboratory: image sequences of rooms that exist nowhere, in COLD's layout."""

from placerec.lab.layout import SCALES, Scale, render_lab

__all__ = ["SCALES", "Scale", "render_lab"]
