"""A tokeniser of one's own: a frame's word is the nearest of K typical colour histograms.

python docs/examples/colours.py lab/ --train 'seq*[12]' -o colours/

writes what `placerec tokenize` writes: a token stream per sequence, and vocab.txt. To make it yours, change `describe`.
"""

import argparse
import sys
from fnmatch import fnmatchcase
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2, vq

from placerec import WordStream, find_sequences, write_stream


def describe(path: Path) -> NDArray[np.float32]:
    """How hues and saturations are distributed in the upper, middle and lower third of an image, float32 (96,)."""
    image = cv2.imread(str(path))
    if image is None:
        raise SystemExit(f"{path}: cannot be read")
    thirds = np.array_split(cv2.cvtColor(image, cv2.COLOR_BGR2HSV), 3)
    counts = [cv2.calcHist([third], [0, 1], None, [8, 4], [0, 180, 0, 256]).ravel() for third in thirds]
    # Square roots, so that large areas of one colour do not drown the rest.
    return np.asarray(np.sqrt(np.concatenate([count / count.sum() for count in counts])), np.float32)


def main() -> None:
    """Describe all frames, find typical histograms in the training sequences, write the nearest one for each frame."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path, nargs="+", help="folders of images, as for `placerec tokenize`")
    parser.add_argument("--train", default="*", help="names of the sequences that the words are learned from")
    parser.add_argument("--words", type=int, default=60)
    parser.add_argument("-o", "--out", type=Path, required=True)
    options = parser.parse_args()

    sequences = find_sequences(options.source)
    described = {each.name: np.array([describe(frame.path) for frame in each.frames]) for each in sequences}
    training = np.concatenate([rows for name, rows in described.items() if fnmatchcase(name, options.train)])
    typical, _ = kmeans2(training, options.words, minit="++", seed=0)

    options.out.mkdir(parents=True, exist_ok=True)
    vocabulary = [f"c{k:02d}" for k in range(len(typical))]
    (options.out / "vocab.txt").write_text("\n".join(vocabulary) + "\n", encoding="utf-8")
    for each in sequences:
        nearest, distances = vq(described[each.name], typical)
        stream = WordStream.of(
            each.name,
            words=[vocabulary[k] for k in nearest],
            places=[frame.place for frame in each.frames],
            frames=[frame.name for frame in each.frames],
            times=[frame.time for frame in each.frames],
            distances=distances,
        )
        write_stream(stream, options.out / f"{each.name}.tsv")
    sys.stdout.write(f"{options.out}: {len(sequences)} sequences, {len(vocabulary)} words\n")


if __name__ == "__main__":
    main()
