"""Geometry: the robot's way is free and continuous, and the camera sees things where they are."""

import numpy as np
import pytest

from placerec.lab.camera import EYE, HALF_WIDTH, camera, develop, look
from placerec.lab.layout import SEQUENCES
from placerec.lab.light import ILLUMINATIONS
from placerec.lab.path import CLEARANCE, STEP, Timing, clear, drive, smooth, tour
from placerec.lab.scene import BRIGHTEST, Scene, light_up, paint, panels_of_run
from placerec.lab.textures import PAINTERS, skin
from placerec.lab.world import CEILING, ROOMS, outline, place

SLOW = Timing({"seq3": (720, 860), "seq4": (1000, 1110)}, 0.13, 0.4, 0.02)


@pytest.fixture(scope="module")
def scene() -> Scene:
    panels = panels_of_run(0, np.random.default_rng(0))
    return light_up(panels, paint(panels, 0, 30), ILLUMINATIONS["cloudy"])


@pytest.mark.parametrize("path", ["seq3", "seq4"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_way_is_free_and_continuous(path: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    walls = outline(panels_of_run(seed, rng))
    poses = drive(path, walls, SLOW, rng)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert steps.max() < 0.5
    assert 0.02 < np.median(steps) < 0.08
    assert 0.06 < (steps < 1e-9).mean() < 0.22
    assert np.abs(np.diff(poses[:, 2])).max() < 1.0
    # Every point between two frames was checked by `drive`; here each pose again, more closely than clear() samples.
    assert clear(poses.repeat(6, axis=0), walls, 0.9 * CLEARANCE)
    places = {place(x, y) for x, y in poses[:, :2]}
    rooms = {"CR-B", "PA-B", "TL-B", "1PO-B"}
    assert places == (rooms | {"KT-B"} if path == "seq4" else rooms)


def test_clear_notices_walls() -> None:
    wall = np.array([[1.0, -1.0, 1.0, 1.0]])
    through = np.stack([np.linspace(0, 2, 200), np.zeros(200)], axis=1)
    assert not clear(through, wall)
    assert clear(through + np.array([0, 1.5]), wall)


def test_smooth_track_has_even_steps_and_follows_its_points() -> None:
    track = smooth(tour("seq4", np.random.default_rng(0)))
    steps = np.hypot(*np.diff(track[:, :2], axis=0).T)
    assert steps.max() < 1.05 * STEP
    way = np.arctan2(*np.diff(track[:, :2], axis=0).T[::-1])
    off = np.abs(np.angle(np.exp(1j * (way - track[1:, 2]))))
    assert np.median(off) < 0.02


def test_camera_has_no_fisheye_and_sees_the_wall_at_its_distance(scene: Scene) -> None:
    # In the printer area, facing west from x = -6 at night-black windows' height: the wall is at x = -7, 1 m away.
    cam = camera(64, 48, 1.0)
    assert cam.columns[-1] == pytest.approx(HALF_WIDTH, rel=0.02)
    black = np.zeros_like(scene.atlas)
    white = Scene(scene.res, black, scene.upright, scene.level, scene.closed)
    walls = (np.abs(scene.upright.corner[:, 0] + 7) < 1e-6) & (np.abs(scene.upright.across[:, 0]) < 1e-6) & scene.closed
    assert walls.sum() == 2
    for spot, across in zip(scene.upright.spot[walls], scene.upright.across[walls], strict=True):
        x, y = spot.astype(int)
        black[y - 1 : y + round(CEILING * 30) + 1, x - 1 : x + round(float(np.hypot(*across[:2])) * 30) + 1] = 255
    seen = look(white, cam, (-6.0, 2.2, np.pi))[..., 0] > 127
    middle = np.flatnonzero(seen[:, 32])
    # Straight edges: the wall is equally high in all columns that show it.
    heights = seen[:, 20:44].sum(axis=0)
    focal = 32 / HALF_WIDTH
    bottom = 24 + focal * EYE / 1.0
    assert middle[-1] + 1 == pytest.approx(min(48, bottom), abs=1.5)
    assert heights.max() - heights.min() <= 1


def test_pictures_change_smoothly_with_the_pose(scene: Scene) -> None:
    cam = camera(64, 48, 2.0)
    track = smooth(tour("seq4", np.random.default_rng(4)))
    near, far = [], []
    for i in range(0, len(track) - 100, len(track) // 25):
        here, step, metre = (look(scene, cam, tuple(track[i + n].tolist())).astype(float) for n in (0, 2, 100))
        near.append(np.abs(step - here).mean())
        far.append(np.abs(metre - here).mean())
    assert max(near) < 12
    assert np.mean(near) < 0.25 * np.mean(far)


def test_no_ray_leaves_the_laboratory(scene: Scene) -> None:
    # A hole between panels would show the atlas's unpainted corner, which is black as no surface is.
    cam = camera(64, 48, 1.0)
    rng = np.random.default_rng(3)
    track = smooth(tour("seq4", rng))
    for x, y, _ in track[:: len(track) // 40]:
        picture = look(scene, cam, (x, y, float(rng.uniform(-np.pi, np.pi))))
        assert (picture.max(axis=2) > 5).all()


def test_develop_is_monotonous_and_adds_the_noise() -> None:
    coded = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    plain = develop(coded, 1.0, np.zeros((16, 16), np.float32))[..., 0].ravel().astype(int)
    assert (np.diff(plain) >= 0).all()
    assert plain[0] == 0
    assert plain[-1] > 250
    brighter = develop(coded, 1.0, np.full((16, 16), 3, np.float32))[..., 0].ravel().astype(int)
    assert (brighter[20:200] - plain[20:200] == 3).all()


def test_windows_are_bright_by_day_and_dark_at_night() -> None:
    panels = panels_of_run(0, np.random.default_rng(0))
    painted = paint(panels, 0, 20)
    glass = [i for i, p in enumerate(panels) if p.room == "office" and any(k == "window" for k, *_ in p.parts)]
    assert len(glass) == 1
    look_of, (x, y) = painted.skins[glass[0]], painted.spots[glass[0]]
    rows, columns = look_of.day.shape
    shown = {}
    for weather in ("cloudy", "night", "sunny"):
        atlas = light_up(panels, painted, ILLUMINATIONS[weather]).atlas[y : y + rows, x : x + columns]
        radiance = (atlas.astype(float) / 255) ** 2 * BRIGHTEST
        shown[weather] = radiance[look_of.day > 0.5].mean()
    assert shown["night"] < 0.1 < 1 < shown["cloudy"] < shown["sunny"]


@pytest.mark.parametrize("kind", sorted(PAINTERS))
def test_every_painter_paints(kind: str) -> None:
    look_of = skin(np.random.default_rng(1), kind, 1.1, 2.0, 30)
    assert look_of.albedo.shape == (60, 33, 3)
    assert look_of.albedo.dtype == np.float32
    assert 0 <= look_of.albedo.min() <= look_of.albedo.max() <= 1.05
    again = skin(np.random.default_rng(1), kind, 1.1, 2.0, 30)
    assert np.array_equal(look_of.albedo, again.albedo)


def test_rooms_do_not_overlap_and_sequences_are_eighteen() -> None:
    for i, a in enumerate(ROOMS):
        for b in ROOMS[i + 1 :]:
            assert a.x1 <= b.x0 or b.x1 <= a.x0 or a.y1 <= b.y0 or b.y1 <= a.y0
    assert len(set(SEQUENCES)) == 18
