"""The table "Views, and other light" of docs/vision.md: what views of a frame are worth, as it is and relit.

python docs/make/light.py DATA --work DIR [--seed N] [--network FILE#LAYER]

DATA: the folder of the sets. The folds are those of weights.py. Everything is learned from frames as they are; tests
are decoded as they are and in every simulated light of `placerec relight`; with an image network as one more view, as
they are alone. What was done is kept in DIR.
"""

import argparse
import json
import logging
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from weights import FOLDS

from placerec import learn
from placerec.evaluation.metrics import evaluate
from placerec.files import write_text
from placerec.methods import decode
from placerec.vision import DescriptorSpec, DictionarySetOptions
from placerec.vision.light import LIGHTS, relight
from placerec.vision.network import Network
from placerec.vision.onnx import open_network

DEFAULT = ("gist", "gist:pn", "lbp:pn", "ranks:pn")
VIEWS = {"gist, gist:pn": DEFAULT[:2], f"{', '.join(DEFAULT)} (default)": DEFAULT}
SHOWN = ("as it is", *LIGHTS)


def relit_set(data: Path, name: str, light: str, work: Path, seed: int = 0) -> Path:
    """The folder in `work` with a set in another light, which is made if it is not there."""
    relit = work / "relit" / name / light
    if not relit.exists():
        relight([data / name], relit, light, seed=seed)
    return relit


def figures(
    data: Path, name: str, fold: int, views: tuple[str, ...], work: Path, seed: int, network: Network | None
) -> dict[str, list[float]]:
    """Frames, accuracy and log loss of a fold's tests in each light; as they are alone where there is a network."""
    kept = work / f"{name}-{fold}-{seed}-{'-'.join(views).replace(':', '')}.json"
    if kept.exists():
        found: dict[str, list[float]] = json.loads(kept.read_text(encoding="utf-8"))
        return found
    every = sorted(path for path in (data / name).iterdir() if path.is_dir())
    tests = [path for path in every if any(path.match(glob) for glob in FOLDS[name][fold])]
    training = [path for path in every if path not in tests]
    model, cache = work / "model", work / "cache"
    words = DictionarySetOptions(views, seed=seed)
    spec = DescriptorSpec(kind=words.kind(), network=network)
    learn(training, model, spec=spec, words=words, cache=cache)
    found = {}
    for light in SHOWN if network is None else SHOWN[:1]:
        sources = tests
        if light in LIGHTS:
            relit = relit_set(data, name, light, work, seed)
            sources = [relit / path.name for path in tests]
        file = None if network is None else network.file
        judged = evaluate(decode(sources, model, out=work / "beliefs", cache=cache, network=file))
        found[light] = [judged.frames, judged.accuracy, judged.log_loss]
    write_text(kept, json.dumps(found) + "\n")
    return found


def lines(data: Path, work: Path, seed: int, network: Network | None) -> Iterator[str]:
    """The table, line by line: for every choice of views a set's accuracy and log loss in each light."""
    yield f"| set | views | {' | '.join(SHOWN)} |"
    yield "| --- | --- |" + " --- |" * len(SHOWN)
    means: dict[str, list[np.ndarray]] = {}
    more = {} if network is None else {"the default and a network": (*DEFAULT, "onnx:pn")}
    for name, folds in FOLDS.items():
        for told, views in (VIEWS | more).items():
            seen = network if told in more else None
            found = [figures(data, name, fold, views, work, seed, seen) for fold in range(len(folds))]
            every = np.array([[*of_fold.values()] for of_fold in found])
            frames = every[:, :, :1]
            mean = (frames * every[:, :, 1:]).sum(axis=0) / frames.sum(axis=0)
            means.setdefault(told, []).append(mean)
            yield _line(name, told, mean)
    for told, of_sets in means.items():
        yield _line("**mean**", told, np.mean(of_sets, axis=0))


def _line(name: str, told: str, mean: np.ndarray) -> str:
    cells = [f"{100 * share:.1f}, {loss:.3f}" for share, loss in mean]
    return f"| {name} | {told} | {' | '.join(cells + [''] * (len(SHOWN) - len(cells)))} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--network")
    options = parser.parse_args()
    file, _, layer = (options.network or "").partition("#")
    logging.disable(logging.WARNING)
    for line in lines(options.data, options.work, options.seed, open_network(file, layer) if file else None):
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
