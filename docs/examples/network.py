"""Descriptors of one's own for placerec's map: a row a frame, as `--descriptor npy:FILE` takes them.

python docs/examples/network.py lab/ -o features.npz

To make it yours, put your network into `features`. Here a thumbnail stands for it, so that the program runs without
any weights.
"""

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec import find_sequences, read_gray


def features(path: Path) -> NDArray[np.float32]:
    """The descriptor of an image, float32 (d,): any d up to 4096, on any scale, compared by Euclidean distance."""
    small = cv2.resize(read_gray(path), (16, 12), interpolation=cv2.INTER_AREA).astype(np.float32).ravel()
    return np.asarray((small - small.mean()) / max(float(small.std()), 1.0), np.float32)


def main() -> None:
    """Describe all frames and write the matrix, with the names of sequence and frame beside each row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=Path, nargs="+", help="folders of images, as for `placerec tokenize`")
    parser.add_argument("-o", "--out", type=Path, required=True)
    options = parser.parse_args()

    named = [(sequence.name, frame) for sequence in find_sequences(options.source) for frame in sequence.frames]
    matrix = np.array([features(frame.path) for _, frame in named])
    np.savez(
        options.out,
        descriptors=matrix,
        sequences=np.array([name for name, _ in named]),
        frames=np.array([frame.name for _, frame in named]),
    )
    sys.stdout.write(f"{options.out}: {len(matrix)} frames of {matrix.shape[1]} numbers\n")


if __name__ == "__main__":
    main()
