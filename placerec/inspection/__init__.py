"""What a dictionary and a recognizer have learned, shown: words, one frame, how stable words are, one decision."""

from placerec.inspection.decision import decision_page, format_decision, inspect_decision
from placerec.inspection.frame import show_frame
from placerec.inspection.word_sheet import show_words
from placerec.inspection.word_stability import stability

__all__ = ["decision_page", "format_decision", "inspect_decision", "show_frame", "show_words", "stability"]
