from dataclasses import replace

import numpy as np
import pytest
from block_laps import block_laps
from scipy.spatial.transform import Rotation

from vgps.simulate import SCENES, build_motion, build_world
from vgps.simulate.camera_path import CameraPath, level_path
from vgps.simulate.motion import center_line
from vgps.simulate.scene import SceneConfig, on_path
from vgps.simulate.world import World

HORIZONTAL = np.array([[0.0, 0, 0.1], [1, 0, 0.1], [2, 1, 0.2]])


def street_of(laps: float, **changes: float) -> SceneConfig:
    scene = replace(SCENES["drive"], texture_scale=0.05, **changes)
    return on_path(scene, level_path(block_laps(laps), 10.0))


def fronts(world: World) -> np.ndarray:
    """Origins of all upright faces, sorted."""
    upright = np.abs(world.edge_v[:, 2]) > 0.1
    return np.unique(world.origin[upright].round(6), axis=0)


def test_the_camera_is_where_the_path_says() -> None:
    poses, config = block_laps(0.5), street_of(0.5)
    made = build_motion(config, np.random.default_rng(0)).poses(np.arange(len(poses)) / 10.0)
    # KITTI's x is right, here south, and its z forward, here east
    np.testing.assert_allclose(
        made[:, :2, 3], np.stack([poses[:, 2, 3], -poses[:, 0, 3]], axis=-1), atol=1e-9
    )
    np.testing.assert_allclose(made[:, 2, 3], config.eye_m, atol=1e-9)
    ahead = np.stack([poses[:, 2, 2], -poses[:, 0, 2], 0 * poses[:, 0, 0]], axis=-1)
    np.testing.assert_allclose(made[:, :3, 2], ahead, atol=1e-9)
    np.testing.assert_allclose(made[:, :3, 1], np.tile([0.0, 0.0, -1.0], (len(poses), 1)), atol=1e-9)
    assert config.frames == len(poses)


def test_hills_go_and_the_vehicles_own_motion_stays() -> None:
    poses = block_laps(0.5, climb=0.1)
    t_s = np.arange(len(poses)) / 10.0
    angles = np.radians([2.0, 0.0, 1.0]) * np.sin(2 * np.pi * 2.0 * t_s)[:, None]
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_euler("xyz", angles).as_matrix()
    path = level_path(poses, 10.0)
    middle = slice(60, -60)
    assert np.abs(path.own_motion[middle, 0]).max() < 0.02
    np.testing.assert_allclose(path.own_motion[middle, 1], angles[middle, 0], atol=2e-3)
    np.testing.assert_allclose(path.own_motion[middle, 2], angles[middle, 2], atol=2e-3)


def test_the_path_goes_on_straight_before_its_start_and_after_its_end() -> None:
    path = CameraPath(10.0, HORIZONTAL, np.ones((3, 3)), HORIZONTAL)
    t_s, values = path.extended(0.1)
    np.testing.assert_allclose(t_s, [-0.1, 0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(values[[0, -1], :2], [[-1, 0], [3, 2]])
    np.testing.assert_allclose(values[[0, -1], 3], [0.1, 0.3])


@pytest.mark.slow
def test_a_street_that_is_passed_again_is_the_same_street() -> None:
    once, twice = street_of(1.3), street_of(2.3)
    worlds = [build_world(config, np.random.default_rng(5)) for config in (once, twice)]
    one, two = (fronts(world) for world in worlds)
    # only where the path goes on straight at its end do they differ
    shared = len({*map(tuple, one.tolist())} & {*map(tuple, two.tolist())})
    assert shared > 0.6 * len(one) and len(two) < 1.2 * len(one)
    camera = build_motion(twice, np.random.default_rng(1)).poses(np.arange(twice.frames) / 10.0)[:, :3, 3]
    world = worlds[1]
    upright = (np.abs(world.edge_v[:, 2]) > 0.1) & (world.origin[:, 2] + world.edge_v[:, 2] < 1.0)
    middle = (world.origin + 0.5 * world.edge_u)[upright, None, :2]
    assert np.linalg.norm(middle - camera[None, :, :2], axis=2).min() > 1.0


@pytest.mark.slow
def test_streets_look_alike_after_the_distance_that_is_asked_for() -> None:
    straight = np.tile(np.eye(4), (400, 1, 1))
    straight[:, 2, 3] = 0.5 * np.arange(400)
    scene = replace(SCENES["drive"], texture_scale=0.05, look_alike_m=50.0)
    config = on_path(scene, level_path(straight, 10.0))
    world = build_world(config, np.random.default_rng(2))
    start = center_line(config, 45.0, 90.0)[0, 1]
    where, texture = world.origin.round(3), world.texture.tolist()
    rows = {(*place, k) for place, k in zip(map(tuple, where.tolist()), texture, strict=True)}
    block = (np.abs(world.edge_v[:, 2]) > 0.1) & (np.abs(where[:, 1]) < 40.0)
    block &= (where[:, 0] > start + 10.0) & (where[:, 0] < start + 60.0)
    again = [(*(where[k] + [50.0, 0.0, 0.0]).round(3).tolist(), texture[k]) for k in np.flatnonzero(block)]
    assert len(again) > 30 and np.mean([one in rows for one in again]) > 0.9


@pytest.mark.parametrize("climb", [0.0, 0.2])
def test_speed_and_duration_are_those_of_the_poses(climb: float) -> None:
    path = level_path(block_laps(1.0, climb), 10.0)
    assert path.speed_m_s == pytest.approx(5.0, rel=1e-3) and path.duration_s == pytest.approx(48.0)


@pytest.mark.slow
def test_parts_of_a_path_are_in_one_world() -> None:
    scene = replace(SCENES["drive"], texture_scale=0.05)
    poses = block_laps(2.0)
    parts = [on_path(scene, level_path(poses, 10.0, part)) for part in (slice(0, 300), slice(480, 700))]
    worlds = [build_world(config, np.random.default_rng(5)) for config in parts]
    np.testing.assert_array_equal(worlds[0].origin, worlds[1].origin)
    assert [config.frames for config in parts] == [300, 220]
    late = build_motion(parts[1], np.random.default_rng(1)).poses(np.zeros(1))[0]
    np.testing.assert_allclose(late[:2, 3], [poses[480, 2, 3], -poses[480, 0, 3]], atol=1e-9)
