"""Writes the laboratory as COLD lays out its sequences (Saarbruecken's style of names)."""

import logging
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.errors import OutputError
from placerec.files import whole_folder
from placerec.jobs import Progress
from placerec.lab.camera import camera, develop, look, mean_radiance
from placerec.lab.light import ILLUMINATIONS, Illumination, illumination
from placerec.lab.path import Timing, Track, drive
from placerec.lab.scene import Paint, light_up, paint, panels_of_run
from placerec.lab.world import Panel, outline, place

README = "README.txt"
OWNED = ("seq[34]_*", README)
SEQUENCES = tuple(
    f"{path}_{weather}{run}" for path in ("seq3", "seq4") for weather in ILLUMINATIONS for run in (1, 2, 3)
)
JPEG_QUALITY = 90
# 7 July 2006, 17:13 UTC: when COLD was recorded in Saarbruecken.
FIRST_DAY = 1152292394.730711
MIDDLE_GREY = 0.22
_FIRST_LINE = "Synthetic image sequences, made by `placerec lab {}`."
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Scale:
    """Size of a laboratory: pictures in pixels, texture in pixels per metre, rays per pixel's side, and timing."""

    width: int
    height: int
    res: float
    fine: float
    timing: Timing


SCALES = {
    "tiny": Scale(160, 120, 50, 1.5, Timing({"seq3": (38, 44), "seq4": (56, 64)}, 0.6, 0.8, 0.01, brief=True)),
    "small": Scale(160, 120, 60, 2.0, Timing({"seq3": (105, 121), "seq4": (150, 174)}, 0.38, 0.7, 0.015)),
    "paper": Scale(320, 240, 80, 1.5, Timing({"seq3": (720, 860), "seq4": (1000, 1110)}, 0.13, 0.4, 0.06)),
}


def render_lab(out: Path | str, *, scale: str = "small", seed: int = 0, progress: Progress | None = None) -> int:
    """Write the laboratory's 18 sequences to the folder `out` and return the number of frames.

    The same scale and seed give the same bytes; a laboratory of others that they take the place of is named in a
    warning. `progress` is called with (frames written, frames in all). Raises
    OutputError for an unknown scale, a negative seed, or a folder that cannot be written or holds other things.
    """
    if scale not in SCALES:
        raise OutputError(f"scale {scale!r} is unknown; use one of {', '.join(SCALES)}")
    if seed < 0:
        raise OutputError(f"seed {seed} is negative; use 0 or more")
    warn_of_another(Path(out), scale, seed)
    return render(Path(out), SCALES[scale], _options(scale, seed), seed, SEQUENCES, progress)


def warn_of_another(folder: Path, scale: str, seed: int) -> None:
    """Warn that a laboratory of this scale and seed will take the place of another one that is in the folder."""
    with suppress(OSError, UnicodeDecodeError):
        first = (folder / README).read_text(encoding="utf-8").partition("\n")[0]
        found = re.fullmatch(re.escape(_FIRST_LINE).replace(r"\{\}", "(--scale .*)"), first)
        if found and found[1] != _options(scale, seed):
            log.warning("%s: was the laboratory of %s, and becomes that of %s", folder, found[1], _options(scale, seed))


def _options(scale: str, seed: int) -> str:
    return f"--scale {scale} --seed {seed}"


def render(
    out: Path, scale: Scale, made_by: str, seed: int, names: tuple[str, ...], progress: Progress | None = None
) -> int:
    """Write the named sequences and the README; see `render_lab`."""
    runs = {name: _plan(name, scale, seed) for name in names}
    total = sum(len(run.poses) for run in runs.values())
    # Furniture moves between runs, but its surfaces stay: they are painted once.
    painted = paint(runs[names[0]].panels, seed, scale.res)
    done = 0
    with whole_folder(out, OWNED) as folder:
        for name, run in runs.items():
            for _ in _record(folder / name, run, painted, scale):
                done += 1
                if progress is not None:
                    progress(done, total)
        (folder / README).write_text(_readme(made_by, len(runs), total), encoding="utf-8", newline="\n")
    return total


@dataclass(frozen=True)
class Run:
    """One sequence before it is rendered: panels, light, poses (n, 4), time stamps (n,), and what draws its noise."""

    panels: tuple[Panel, ...]
    light: Illumination
    poses: Track
    times: NDArray[np.float64]
    rng: np.random.Generator


def _plan(name: str, scale: Scale, seed: int) -> Run:
    # A generator of its own for every sequence: it looks the same whatever else is rendered, and in what order.
    rng = np.random.default_rng([seed, *name.encode()])
    path, weather = name[:-1].split("_")
    panels = panels_of_run(seed, rng)
    light = illumination(weather, rng)
    poses = drive(path, outline(panels), scale.timing, rng)
    start = FIRST_DAY + 1800 * SEQUENCES.index(name) + float(rng.uniform(0, 600))
    steps = np.clip(rng.normal(0.205, 0.006, len(poses)), 0.19, 0.23)
    return Run(tuple(panels), light, poses, start + np.cumsum(steps), rng)


def _record(folder: Path, run: Run, painted: Paint, scale: Scale) -> Iterator[None]:
    """Render and write one sequence; yields after every frame."""
    cam = camera(scale.width, scale.height, scale.fine)
    scene = light_up(run.panels, painted, run.light)
    for part in ("std_cam", "localization"):
        (folder / part).mkdir(parents=True)
    lines: list[str] = []
    exposure = 0.0
    for (x, y, heading, pitch), time in zip(run.poses.tolist(), run.times.tolist(), strict=True):
        coded = look(scene, cam, (x, y, heading), pitch)
        wanted = run.light.exposure * (MIDDLE_GREY / mean_radiance(coded)) ** 0.5
        # Automatic exposure takes a few frames to follow.
        exposure = wanted if not lines else exposure + 0.4 * (wanted - exposure)
        noise = run.rng.standard_normal((scale.height, scale.width), dtype=np.float32) * np.float32(run.light.noise)
        angle = float(np.arctan2(np.sin(heading), np.cos(heading)))
        name = f"t{time:.6f}_x{x:.7f}_y{y:.7f}_a{angle:.7f}.jpeg"
        (folder / "std_cam" / name).write_bytes(_jpeg(develop(coded, exposure, noise)))
        lines.append(f"{name} {place(x, y)}\n")
        yield
    (folder / "localization" / "places.lst").write_text("".join(lines), encoding="utf-8", newline="\n")


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    good, data = cv2.imencode(".jpeg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not good:
        raise OutputError("a frame of the laboratory could not be encoded as JPEG; check the OpenCV installation")
    return bytes(data.tobytes())


def _readme(made_by: str, sequences: int, frames: int) -> str:
    return f"""{_FIRST_LINE.format(made_by)}

No camera saw these rooms: a small laboratory was drawn and a robot's drive through it was rendered. The folders, file
names and labels are laid out as in the COLD database (Saarbruecken, part B); no picture and no number is COLD's.
Results on these {sequences} sequences ({frames} frames) show how placerec works, not how well it does on real images.

  seq3_*  the standard path: corridor, toilet, office, printer area
  seq4_*  the extended path: the kitchen as well
  Labels are COLD's: CR-B corridor, TL-B toilet, 1PO-B office, PA-B printer area, KT-B kitchen
  cloudy, night, sunny: the light; 1, 2, 3: the run
  std_cam/t<seconds>_x<metres>_y<metres>_a<radians>.jpeg, localization/places.lst: <file> <place>
"""
