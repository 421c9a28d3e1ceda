import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.config import StartConfig
from vgps.gps.fixes import place
from vgps.smoothing.alignment import _travel, align

ANTENNA = np.array([0.1, -0.9, -0.3])
LOOKS_NORTH = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def drive(turn_rad, frames=12):
    """World poses on an arc of 40 m, upright, looking ahead."""
    angle = np.linspace(0, turn_rad, frames)
    step = 40 / frames * np.stack([np.sin(angle), np.cos(angle), np.zeros(frames)], axis=1)
    out = np.tile(np.eye(4), (frames, 1, 1))
    out[:, :3, 3] = np.array([100.0, -50.0, 7.0]) + np.cumsum(step, axis=0)
    out[:, :3, :3] = Rotation.from_rotvec(-angle[:, None] * [0, 0, 1]).as_matrix() @ LOOKS_NORTH
    return out


def in_map(world, scale, rotation, place_):
    out = world.copy()
    out[:, :3, 3] = (world[:, :3, 3] - place_) @ rotation / scale
    out[:, :3, :3] = rotation.T @ world[:, :3, :3]
    return out


@pytest.mark.parametrize(("turn_rad", "straight"), [(1.2, False), (0.0, True)])
@pytest.mark.parametrize("outlier_m", [0.0, 15.0])
def test_recovers_the_similarity_with_the_lever_arm(turn_rad, straight, outlier_m):
    world = drive(turn_rad)
    rotation, place_ = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix(), np.array([90.0, -40.0, 5.0])
    fixes = world[:, :3, :3] @ ANTENNA + world[:, :3, 3]
    fixes[5, 0] += outlier_m
    region = np.full((len(world), 3), 0.07)
    found = align(in_map(world, 3.7, rotation, place_), fixes, region, ANTENNA, StartConfig())
    assert found is not None and found.straight == straight
    assert found.to_world.scale == pytest.approx(3.7, rel=0.01)
    error = Rotation.from_matrix(found.to_world.world_R_map @ rotation.T).magnitude()
    assert np.degrees(error) < 1.0


def test_fixes_of_too_small_an_extent_do_not_align():
    world = drive(1.0)
    world[:, :3, 3] = world[0, :3, 3] + 0.02 * (world[:, :3, 3] - world[0, :3, 3])
    fixes = world[:, :3, :3] @ ANTENNA + world[:, :3, 3]
    region = np.full((len(world), 3), 0.07)
    assert align(world, fixes, region, ANTENNA, StartConfig()) is None
    assert align(world[:2], fixes[:2] * 100, region[:2], ANTENNA, StartConfig()) is None


def test_fixes_are_placed_between_frames_by_time():
    placement = place(np.array([0.0, 0.1, 0.3]), np.array([-0.01, 0.0, 0.1, 0.25, 0.3, 0.31]))
    assert placement.inside.tolist() == [False, True, True, True, True, False]
    assert placement.frame[1:5].tolist() == [0, 1, 1, 1]
    np.testing.assert_allclose(placement.alpha[1:5], [0.0, 0.0, 0.75, 1.0])


def test_a_stop_does_not_reduce_the_extent_and_one_outlier_does_not_raise_it():
    way = np.stack([np.linspace(0, 20, 11), np.zeros(11), np.zeros(11)], axis=1)
    stop = np.tile(way[-1:], (40, 1))
    assert _travel(np.concatenate([way, stop]), 1.0, 6) > 8.0
    wrong = np.array([[50.0, 0.0, 0.0]])
    assert _travel(np.concatenate([stop, stop + 0.1, wrong]), 1.0, 6) < 0.5
    assert _travel(way[:3], 1.0, 6) == 4.0
