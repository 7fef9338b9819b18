"""Simulated changes of light: what the same camera might have seen with other lamps, exposures and sensors.

Real recordings of one building in several lights are rare; these stand in for them, and every number that comes of
them is called simulated. An image's levels v of 0..255 are taken as linear light (v / 255)^2.2, changed there, brought
back, rounded and cut to 0..255; `placerec relight` stores it as a JPEG of quality 90 again, as a camera would.

dim       a fifth of the light, with shot noise (1,000 electrons at full scale) and read noise of 3 electrons
warm      red x (1 + s/4), green x (1 - 0.08 s), blue x (1 - 0.45 s), with s of 0.7 to 1.3
lamp      from one side: there 1.3 times the light in a colour, 0.7 on the other side, linear between
exposure  x 0.45 or x 2.2

What is drawn (s, the side, the colour, the factor) is drawn once for a sequence; noise is drawn for every frame.
"""

import logging
import math
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from placerec.arrays import Singles
from placerec.errors import SourceError, VisionError
from placerec.files import whole_folder
from placerec.frames import Sequence, SourceOptions, all_images, find_sequences
from placerec.frames.layouts import COLD_LIST, COLD_LIST_FOLDER
from placerec.frames.sequence import ColourImage, Colours, Frame, Image
from placerec.jobs import Progress

log = logging.getLogger(__name__)

README = "README.txt"
_HEAD = "Real frames under simulated light, by `placerec relight`"
CAMERA = "std_cam"
_GAMMA = 2.2
_LINEAR = ((np.arange(256) / 255) ** _GAMMA).astype(np.float32)
_ELECTRONS, _READ = 1000, 3.0
# Blue, green, red: daylight, a bulb, an old fluorescent tube.
_LAMPS = ((1.6, 0.8, 0.45), (0.6, 1.0, 1.6), (0.8, 1.5, 0.7))
_QUALITY = 90


def relight(
    sources: Iterable[Path | str],
    out: Path | str,
    light: str,
    *,
    seed: int = 0,
    source_options: SourceOptions = SourceOptions(),
    progress: Progress | None = None,
) -> int:
    """`placerec relight`: write the folder `out` with every sequence in another light, in COLD's layout, and labelled.

    Returns the number of frames. An image that cannot be read is named in a warning and left out. `progress` is called
    with frames done and in all. Raises VisionError for an unknown light and if no image can be read, SourceError for
    sources, OutputError for the folder.
    """
    _check(light)
    written = 0
    with whole_folder(Path(out), _owned(Path(out))) as folder:
        sequences = find_sequences(sources, options=source_options)
        total = sum(len(one.frames) for one in sequences)
        done = 0
        for sequence in sequences:
            for kept in relight_sequence(sequence, folder / sequence.name, light, seed=seed):
                written += kept
                done += 1
                if progress is not None:
                    progress(done, total)
        if not written:
            raise VisionError(f"none of the {total} images can be read; name a folder with images")
        (folder / README).write_text(f"{_HEAD}: {light}, seed {seed}.\n", encoding="utf-8", newline="\n")
    return written


def _owned(out: Path) -> tuple[str, ...]:
    """What may be replaced: all that `relight` wrote, and nothing where something else did."""
    try:
        with (out / README).open(encoding="utf-8") as file:
            return ("*",) if file.read(len(_HEAD)) == _HEAD else ()
    except (OSError, UnicodeDecodeError):
        return ()


def relight_sequence(sequence: Sequence, folder: Path, light: str, *, seed: int) -> Iterator[bool]:
    """Write a sequence in another light to a new folder, and yield for every frame whether it could be read.

    `relit_sequence` is what it then is. Raises VisionError for an unknown light, and SourceError for two frames that
    would be one file.
    """
    _check(light)
    names = [_name(frame, number) for number, frame in enumerate(sequence.frames)]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise SourceError(f"{sequence.source}: two frames would both be stored as {twice}; rename one")
    labels = []
    (folder / CAMERA).mkdir(parents=True)
    (folder / COLD_LIST_FOLDER).mkdir()
    for number, (frame, image) in enumerate(all_images(sequence, colours=True)):
        if isinstance(image, str):
            log.warning("%s; the frame is left out", image)
            yield False
            continue
        name = names[number]
        stored = relit_jpeg(image, light, seed=seed, sequence=sequence.name, frame=number)
        (folder / CAMERA / name).write_bytes(stored)
        if frame.place:
            labels.append(f"{name} {frame.place}\n")
        yield True
    (folder / COLD_LIST_FOLDER / COLD_LIST).write_text("".join(labels), encoding="utf-8", newline="\n")


def relit_sequence(sequence: Sequence, folder: Path) -> Sequence:
    """What `relight_sequence` wrote of a sequence to the folder: the name, the times and the places are its own."""
    names = [(frame, _name(frame, number)) for number, frame in enumerate(sequence.frames)]
    frames = [replace(frame, name=name, path=folder / CAMERA / name) for frame, name in names]
    return Sequence(sequence.name, [frame for frame in frames if frame.path.exists()], folder)


def _name(frame: Frame, number: int) -> str:
    """The file's name: that of the frame's own file, or what tells the time of a frame of a recording."""
    if frame.path.name == frame.name:
        return f"{Path(frame.name).stem}.jpeg"
    return f"frame_{number:06d}.jpeg" if math.isnan(frame.time) else f"t{frame.time:.6f}.jpeg"


def relit_jpeg(image: Image, light: str, *, seed: int, sequence: str, frame: int) -> bytes:
    """An image of 0..255 in another light, as `relight` stores it: a JPEG of quality 90, in colours.

    Arguments otherwise, and what is raised: see `relit`.
    """
    pixels = image.colours if isinstance(image, ColourImage) else image
    levels = np.rint(pixels.clip(0, 255)).astype(np.uint8)
    found = relit(levels, light, seed=seed, sequence=sequence, frame=frame)
    _, stored = cv2.imencode(".jpg", found, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return stored.tobytes()


def relit(image: Colours, light: str, *, seed: int, sequence: str, frame: int) -> Colours:
    """An image uint8 (h, w, 3) blue, green, red, or grey (h, w), in another light, one of LIGHTS: uint8 (h, w, 3).

    `seed` and `sequence` decide what is drawn for the whole sequence, the number `frame` the noise. The same arguments
    give the same bytes. Raises VisionError for an unknown light.
    """
    _check(light)
    key = [seed, zlib.crc32(light.encode()), zlib.crc32(sequence.encode())]
    of_sequence, of_frame = (np.random.Generator(np.random.PCG64(some)) for some in (key, [*key, frame]))
    colours = image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2)
    linear = LIGHTS[light](_LINEAR[colours], of_sequence, of_frame)
    levels: Colours = np.rint(255 * np.clip(linear, 0, 1) ** (1 / _GAMMA)).astype(np.uint8)
    return levels


def _check(light: str) -> None:
    if light not in LIGHTS:
        raise VisionError(f"no simulated light is called {light!r}; choose one of {', '.join(LIGHTS)}")


def _dim(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    seen = of_frame.poisson(linear * 0.2 * _ELECTRONS) + of_frame.normal(0, _READ, linear.shape)
    return (seen / _ELECTRONS).astype(np.float32)


def _warm(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    s = of_sequence.uniform(0.7, 1.3)
    return linear * np.array([1 - 0.45 * s, 1 - 0.08 * s, 1 + 0.25 * s], np.float32)


def _lamp(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    near = np.linspace(0, 1, linear.shape[1], dtype=np.float32)[None, :, None]
    if of_sequence.integers(2):
        near = 1 - near
    colour = np.array(_LAMPS[of_sequence.integers(len(_LAMPS))], np.float32)
    return linear * (0.7 * (1 - near) + 1.3 * near * colour)


def _exposure(linear: Singles, of_sequence: np.random.Generator, of_frame: np.random.Generator) -> Singles:
    return linear * np.float32(0.45 if of_sequence.integers(2) else 2.2)


_Change = Callable[[Singles, np.random.Generator, np.random.Generator], Singles]
LIGHTS: dict[str, _Change] = {"dim": _dim, "warm": _warm, "lamp": _lamp, "exposure": _exposure}
