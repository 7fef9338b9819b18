"""The camera: a column ray caster for walls, and a depth buffer for what stands before them.

Depths are perpendicular to the picture (no fisheye); rays are (1, k) with k the column's tangent. A frame is worked out
as one map of atlas positions and sampled once, which is what makes it quick.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.lab.scene import BRIGHTEST, Panels, Scene
from placerec.lab.world import CEILING

Array = NDArray[np.float32]

EYE = 1.15
NEAR = 0.05
FAR = 1e3
# COLD's perspective camera sees 68.9 degrees across.
HALF_WIDTH = float(np.tan(np.radians(68.9 / 2)))


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: picture size, and per column and row the tangent of its ray (right and down positive)."""

    width: int
    height: int
    columns: Array
    rows: Array


def camera(width: int, height: int, fine: float = 2.0) -> Camera:
    """A camera for pictures of width x height, which casts `fine` rays for each pixel's side."""
    w, h = round(width * fine), round(height * fine)
    focal = w / 2 / HALF_WIDTH
    k, v = (((np.arange(n) + 0.5 - n / 2) / focal).astype(np.float32) for n in (w, h))
    return Camera(width, height, k, v)


@dataclass(frozen=True)
class _Frame:
    """Where each pixel looks: atlas position (u, v) and depth, filled in by the drawing functions."""

    u: Array
    v: Array
    depth: Array


def look(scene: Scene, cam: Camera, pose: tuple[float, float, float], pitch: float = 0.0) -> NDArray[np.uint8]:
    """The picture (height, width, 3) uint8 RGB seen from pose (x, y, heading), coded as the atlas is.

    Angles in radians; a small `pitch` (up is positive) moves the horizon, without the tilt of uprights.
    """
    x, y, a = pose
    turn = np.array([[np.cos(a), np.sin(a)], [np.sin(a), -np.cos(a)]], np.float32)
    standing, level = (_seen_from(p, np.array([x, y]), turn) for p in (scene.upright, scene.level))
    tilted = replace(cam, rows=cam.rows - np.float32(np.tan(pitch)))
    frame = _cast(scene, tilted, standing, level)
    picture = cv2.remap(scene.atlas, frame.u, frame.v, cv2.INTER_LINEAR)
    small = cv2.resize(picture, (cam.width, cam.height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def _seen_from(panels: Panels, position: NDArray[np.float64], turn: Array) -> Panels:
    """The panels with x, y replaced by depth and offset to the right."""
    edges = np.stack([panels.corner, panels.across, panels.down])
    edges[0, :, :2] -= position.astype(np.float32)
    x, y = edges[..., 0].copy(), edges[..., 1].copy()
    for i in (0, 1):
        edges[..., i] = turn[i, 0] * x + turn[i, 1] * y
    return Panels(edges[0], edges[1], edges[2], panels.spot)


def _cast(scene: Scene, cam: Camera, standing: Panels, level: Panels) -> _Frame:
    """What every ray hits: walls first, then level panels, then what stands before them."""
    start, edge = standing.corner[:, :2], standing.across[:, :2]
    # Seen from its front, a panel's start is on the left.
    facing = (start[:, 0] * edge[:, 1] - start[:, 1] * edge[:, 0] > 0) & (
        np.maximum(start[:, 0], start[:, 0] + edge[:, 0]) > NEAR
    )
    index = np.flatnonzero(facing)
    p, e, k = start[index][:, :, None], edge[index][:, :, None], cam.columns
    slope = e[:, 1] - k * e[:, 0]
    along = np.asarray((k * p[:, 0] - p[:, 1]) / np.where(np.abs(slope) < 1e-9, np.float32(1e-9), slope), np.float32)
    depth = np.asarray(p[:, 0] + along * e[:, 0], np.float32)
    depth[(along < 0) | (along > 1) | (depth < NEAR)] = FAR
    walls = np.flatnonzero(scene.closed[index])
    nearest = walls[np.argmin(depth[walls], axis=0)]
    column = np.arange(len(k))
    frame = _walls(scene, cam, standing, index[nearest], along[nearest, column], depth[nearest, column])
    reach = frame.depth[0].copy()
    for i, part, rows in _levels_in_view(cam, level, float(reach.max())):
        _draw_level(frame, cam, level, i, scene.res, part, rows)
    before = (depth < reach) & ~scene.closed[index][:, None]
    for row in np.flatnonzero(before.any(axis=1)):
        hit = np.flatnonzero(before[row])
        part = slice(int(hit[0]), int(hit[-1]) + 1)
        _draw_upright(frame, cam, standing, int(index[row]), scene.res, part, along[row, part], depth[row, part])
    return frame


def _walls(scene: Scene, cam: Camera, panels: Panels, which: NDArray[np.intp], along: Array, depth: Array) -> _Frame:
    """The nearest wall of each column, from top to bottom of the picture; floor and ceiling come later."""
    length = np.hypot(panels.across[which, 0], panels.across[which, 1])
    u = panels.spot[which, 0] + along * length * scene.res - 0.5
    z = EYE - cam.rows[:, None] * depth
    v = panels.spot[which, 1] + (CEILING - z) * scene.res - 0.5
    shape = z.shape
    return _Frame(np.tile(u, (shape[0], 1)), v, np.tile(depth, (shape[0], 1)))


def _draw_upright(
    frame: _Frame, cam: Camera, panels: Panels, i: int, res: float, part: slice, along: Array, depth: Array
) -> None:
    high, tall = panels.corner[i, 2], -panels.down[i, 2]
    # Rows between the nearest column's top and bottom edge.
    near = max(float(depth.min()), NEAR)
    far = float(depth.max())
    tops, ends = (EYE - high) / near, (EYE - high + tall) / near
    top, end = min(tops, (EYE - high) / far), max(ends, (EYE - high + tall) / far)
    rows = slice(int(np.searchsorted(cam.rows, top)), int(np.searchsorted(cam.rows, end)))
    below = high - EYE + cam.rows[rows, None] * depth
    seen = (below >= 0) & (below <= tall) & (depth < frame.depth[rows, part])
    length = np.hypot(panels.across[i, 0], panels.across[i, 1])
    u = panels.spot[i, 0] + along * length * res - np.float32(0.5)
    np.copyto(frame.u[rows, part], u, where=seen)
    np.copyto(frame.v[rows, part], panels.spot[i, 1] + below * res - np.float32(0.5), where=seen)
    np.copyto(frame.depth[rows, part], depth, where=seen)


def _levels_in_view(cam: Camera, panels: Panels, reach: float) -> Iterator[tuple[int, slice, slice]]:
    """The level panels that may be seen: number, and the columns and rows of the picture that hold them."""
    across, down, corner = panels.across[:, :2], panels.down[:, :2], panels.corner[:, :2]
    ends = np.stack([corner, corner + across, corner + down, corner + across + down], axis=1)
    drop = EYE - panels.corner[:, 2]
    # A top is seen from above, an underside from below.
    faces = (across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0] > 0) == (drop > 0)
    near, far = np.maximum(ends[..., 0].min(axis=1), np.float32(NEAR)), ends[..., 0].max(axis=1)
    tangents = ends[..., 1] / np.maximum(ends[..., 0], np.float32(NEAR))
    # With a corner behind the camera the tangents say nothing, and all columns are looked at.
    behind = ends[..., 0].min(axis=1) < NEAR
    left = np.searchsorted(cam.columns, np.where(behind, -np.inf, tangents.min(axis=1)))
    right = np.searchsorted(cam.columns, np.where(behind, np.inf, tangents.max(axis=1)))
    edges = np.sort(drop[:, None] / np.stack([near, np.maximum(far, np.float32(NEAR))], axis=1), axis=1)
    top, bottom = np.searchsorted(cam.rows, edges[:, 0]), np.searchsorted(cam.rows, edges[:, 1])
    chosen = faces & (far > NEAR) & (near < reach) & (left < right) & (top < bottom)
    for i in np.flatnonzero(chosen).tolist():
        yield i, slice(left[i], right[i]), slice(top[i], bottom[i])


def _draw_level(frame: _Frame, cam: Camera, panels: Panels, i: int, res: float, part: slice, rows: slice) -> None:
    corner, across, down = panels.corner[i, :2], panels.across[i, :2], panels.down[i, :2]
    depth = ((EYE - panels.corner[i, 2]) / cam.rows[rows])[:, None]
    if depth.min() >= frame.depth[rows, part].max():
        return
    k = cam.columns[part]
    s, t = (
        (depth * ((side[0] + side[1] * k) / (side @ side)) - (corner @ side) / (side @ side)) for side in (across, down)
    )
    slack = np.float32(0.5 + 2e-3)
    seen = (np.abs(s - 0.5) <= slack) & (np.abs(t - 0.5) <= slack) & (depth < frame.depth[rows, part])
    if not seen.any():
        return
    width, height = np.float32(np.hypot(*across)), np.float32(np.hypot(*down))
    np.copyto(frame.u[rows, part], s * (width * res) + (panels.spot[i, 0] - np.float32(0.5)), where=seen)
    np.copyto(frame.v[rows, part], t * (height * res) + (panels.spot[i, 1] - np.float32(0.5)), where=seen)
    np.copyto(frame.depth[rows, part], depth, where=seen)


def develop(coded: NDArray[np.uint8], exposure: float, noise: Array) -> NDArray[np.uint8]:
    """Turn coded radiance into a grey-corrected picture: film curve, then `noise` (h, w) in grey levels."""
    radiance = (np.arange(256, dtype=np.float64) / 255) ** 2 * BRIGHTEST
    curve = 255 * (1 - np.exp(-1.5 * exposure * radiance)) ** (1 / 1.8)
    picture = np.asarray(cv2.LUT(coded, curve.astype(np.float32)), np.float32)
    picture += noise[..., None]
    return np.asarray(np.clip(picture + 0.5, 0, 255), np.uint8)


def mean_radiance(coded: NDArray[np.uint8]) -> float:
    """Mean radiance of a coded picture: what an automatic exposure measures."""
    return float(np.mean(coded.astype(np.float32) ** 2)) * BRIGHTEST / 255**2
