"""The pictures of docs/concepts.md, as SVG: a small example, computed by placerec.reference.

python docs/make/concepts.py docs/concepts

Letters are at least 26 of 720 units high, so that they are still read where the page is 360 pixels wide.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from placerec.reference import Model, backed_off, belief as beliefs, count, smoothed

WORDS = ("w1", "w2", "w3", "w4")
# Two drives; each frame with its place and its word.
KITCHEN, CORRIDOR = "kitchen", "corridor"
COLOURS = {KITCHEN: "#c2571a", CORRIDOR: "#2f6fa7"}
DRIVES = (
    ((CORRIDOR, "w3 w3 w4"), (KITCHEN, "w1 w1 w2 w1"), (CORRIDOR, "w4 w3")),
    ((CORRIDOR, "w3 w4"), (KITCHEN, "w1 w2"), (CORRIDOR, "w2 w3 w3")),
)
NEW = ("w3", "w4", "w1", "w2", "w1", "w3", "w3")
STAY = 0.9
GREY, LIGHT = "#555", "#d8d8d8"


def models() -> dict[str, Model]:
    """The bigram model of each place, Witten-Bell."""
    sentences = {
        place: [words.split() for drive in DRIVES for where, words in drive if where == place] for place in COLOURS
    }
    return {place: smoothed(count(text, 2), WORDS, 2, "witten-bell", 1.0) for place, text in sentences.items()}


def text(x: float, y: float, said: str, *, size: int = 28, at: str = "middle", colour: str = "#222") -> str:
    """A line of text whose baseline is at y."""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="{at}" fill="{colour}">{said}</text>\n'


def box(x: float, y: float, width: float, height: float, colour: str, edge: str = "none") -> str:
    """A rectangle."""
    frame = f'x="{x:g}" y="{y:g}" width="{width:.1f}" height="{height:.1f}"'
    return f'<rect {frame} fill="{colour}" stroke="{edge}" stroke-width="2"/>\n'


def line(x1: float, y1: float, x2: float, y2: float, width: float = 2, colour: str = GREY) -> str:
    """A line."""
    ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{width:g}" stroke-linecap="round"/>\n'


def arrow(x: float, y: float) -> str:
    """An arrow to the right that begins at x."""
    return line(x, y, x + 36, y, 4) + line(x + 36, y, x + 24, y - 10, 4) + line(x + 36, y, x + 24, y + 10, 4)


def svg(height: int, said: str, parts: Sequence[str]) -> str:
    """A picture 720 wide; `said`: what it shows, for those who cannot see it."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 720 {height}" font-family="sans-serif" role="img">\n'
    return f"{head}<title>{said}</title>\n{''.join(parts)}</svg>\n"


def frame_to_word() -> str:
    """A frame, its edges in 4 x 4 windows, and the nearest unit of the map."""
    room = [
        box(10, 20, 200, 200, "#f4efe6", GREY),
        line(10, 220, 70, 150),
        line(210, 220, 150, 150),
        line(70, 150, 150, 150),
    ]
    room += [line(70, 150, 70, 20), line(150, 150, 150, 20), box(88, 70, 44, 80, "#b98b5e", GREY)]
    roses, units = [box(264, 20, 200, 200, "#fff", GREY)], []
    for row in range(4):
        for column in range(4):
            x, y = 289 + 50 * column, 45 + 50 * row
            for k in range(6):
                upright = abs(math.sin(math.pi * k / 6))
                length = 4 + 17 * (
                    upright**3 if column in (1, 2) or row < 2 else abs(math.cos(math.pi * k / 6 + 0.8)) ** 3
                )
                dx, dy = length * math.cos(math.pi * k / 6), length * math.sin(math.pi * k / 6)
                roses.append(line(x - dx, y - dy, x + dx, y + dy, 3, "#7a4fa3"))
            hit = (row, column) == (1, 2)
            circle = (
                f'<circle cx="{542 + 50 * column}" cy="{y}" r="20" fill="{COLOURS[CORRIDOR] if hit else LIGHT}"/>\n'
            )
            units.append(circle)
    captions = [(110, "a frame", ""), (364, "its edges", "in 16 windows"), (610, "nearest unit", "of a map: w06")]
    said = [text(x, 260, first) + text(x, 294, second) for x, first, second in captions]
    return svg(
        310,
        "A frame becomes edges in 16 windows, and these the nearest unit of a map",
        [*room, arrow(219, 120), *roses, arrow(473, 120), *units, *said],
    )


def sentences() -> str:
    """The first drive, cut into visits."""
    parts, x, width = [], 0.0, 78
    for place, words in DRIVES[0]:
        start = x
        for word in words.split():
            parts += [box(x + 11, 20, width - 10, 56, COLOURS[place]), text(x + 6 + width / 2, 116, word)]
            x += width
        parts += [
            line(start + 13, 134, x - 1, 134, 5, COLOURS[place]),
            text((start + x) / 2 + 6, 168, place, colour=COLOURS[place]),
        ]
    parts.append(text(360, 222, "three visits, three sentences", colour=GREY))
    return svg(240, "A drive of nine frames: corridor, kitchen, corridor; each visit is a sentence", parts)


def ngrams(model: Model) -> str:
    """What follows w1 in the kitchen."""
    parts = [text(10, 44, "kitchen's sentences:", at="start", colour=GREY)]
    shown = [words for drive in DRIVES for place, words in drive if place == KITCHEN]
    parts += [
        text(10, 92 + 44 * i, words, at="start", size=32, colour=COLOURS[KITCHEN]) for i, words in enumerate(shown)
    ]
    parts.append(text(360, 44, "so after w1 comes ...", at="start", colour=GREY))
    for i, word in enumerate(WORDS):
        p, y = backed_off(model, word, ("w1",)), 64 + 46 * i
        parts += [
            text(400, y + 28, word),
            box(436, y + 4, 300 * p, 30, COLOURS[KITCHEN]),
            text(446 + 300 * p, y + 28, f"{p:.2f}", at="start"),
        ]
    parts.append(text(360, 290, "w3 and w4 never came there, and get a little", colour=GREY))
    return svg(310, "The kitchen's sentences and the probabilities of the words after w1", parts)


def places(both: dict[str, Model]) -> str:
    """The probability of each word after each word, in each place."""
    parts = []
    for left, (place, model) in zip((100, 470), both.items(), strict=True):
        parts.append(text(left + 104, 34, f"{place}: next word", colour=COLOURS[place]))
        for column, word in enumerate(WORDS):
            parts.append(text(left + 26 + 52 * column, 72, word))
        for row, before in enumerate(WORDS):
            parts.append(text(left - 8, 118 + 52 * row, before, at="end"))
            for column, word in enumerate(WORDS):
                p = backed_off(model, word, (before,))
                cell = box(left + 2 + 52 * column, 84 + 52 * row, 48, 48, COLOURS[place], LIGHT)
                parts.append(cell.replace("/>", f' fill-opacity="{p:.2f}"/>'))
    parts += [text(22, 196, "word before", colour=GREY).replace("<text", '<text transform="rotate(-90 22 196)"')]
    return svg(306, "The probability of each word after each word, in the kitchen and in the corridor", parts)


def belief(both: dict[str, Model]) -> str:
    """The belief over the places of a new drive, before and after each word."""
    after = beliefs(NEW, list(both.values()), 2, STAY)
    parts = [text(10, 32, "word", at="start", colour=GREY)]
    for row, place in enumerate(both):
        base = 190 + 150 * row
        parts += [text(10, base - 40, place, at="start", colour=COLOURS[place]), line(140, base, 716, base)]
        for i, word in enumerate(NEW):
            x = 150 + 82 * i
            before = 0.5 if i == 0 else STAY * after[i - 1][row] + (1 - STAY) * after[i - 1][1 - row]
            parts += [
                box(x, base - 110 * before, 28, 110 * before, LIGHT),
                box(x + 30, base - 110 * after[i][row], 36, 110 * after[i][row], COLOURS[place]),
            ]
            if row == 0:
                parts.append(text(x + 33, 32, word))
    parts.append(text(428, 384, "light: before the word; dark: after it", colour=GREY))
    return svg(400, "The belief in kitchen and corridor before and after each of seven words", parts)


def pictures() -> dict[str, str]:
    """All pictures by file name."""
    both = models()
    drawn = {
        "frame": frame_to_word(),
        "sentences": sentences(),
        "ngrams": ngrams(both[KITCHEN]),
        "places": places(both),
        "belief": belief(both),
    }
    return {f"{name}.svg": picture for name, picture in drawn.items()}


if __name__ == "__main__":
    for name, picture in pictures().items():
        Path(sys.argv[1], name).write_text(picture, encoding="utf-8")
