"""Two runs of images, all the way to beliefs."""

from pathlib import Path

from helpers.small_world import write_images
from helpers.typed_commands import done


def write_decoded_images(root: Path) -> Path:
    """`root` with runs/, words.npz, tokens/, model/, beliefs/ with explanations, and others/ of another method."""
    for seed, name in enumerate(("run1", "run2")):
        write_images(root / "runs" / name, seed)
    done("train-words", root / "runs", "-o", root / "words.npz", "--size", 2, "--components", 4, "-q")
    done("tokenize", root / "runs", "-w", root / "words.npz", "-o", root / "tokens", "-q")
    done("train-lm", root / "tokens", "-o", root / "model", "-q")
    done("decode", root / "tokens", "-m", root / "model", "-o", root / "beliefs", "--explain", "-q")
    done("decode", root / "tokens", "-m", root / "model", "-o", root / "others", "--method", "naive-bayes", "-q")
    return root
