"""The ground below a path: synthetic drives of known height, and places without a plane."""

from dataclasses import replace

import numpy as np
import pytest

from vgps.smoothing.scene.camera_heights import CameraHeights, measure_heights
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations

HEIGHT, STEP, FRAMES = 1.5, 0.8, 200


def poses_of(bend: float = 0.003) -> np.ndarray:
    """Return (F, 4, 4) a drive on level ground with a bend, rad per frame; the camera looks ahead."""
    yaw = bend * np.arange(FRAMES)
    forward = np.stack([np.sin(yaw), np.cos(yaw), np.zeros(FRAMES)], axis=1)
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, 2], poses[:, :3, 1] = forward, [0.0, 0.0, -1.0]
    poses[:, :3, 0] = np.cross(poses[:, :3, 1], forward)
    poses[1:, :3, 3] = np.cumsum(STEP * forward[:-1], axis=0)
    return poses


def scene_of(poses: np.ndarray, across: np.ndarray, down: np.ndarray, foot: np.ndarray) -> Scene:
    """Return landmarks beside and below frames, each observed from 12 frames before to 4 before."""
    at = poses[foot]
    points = at[:, :3, 3] + across[:, None] * at[:, :3, 0] + down[:, None] * at[:, :3, 1]
    ahead = np.arange(4, 13)
    frame = np.maximum(foot[:, None] - ahead, 0)
    landmark = np.repeat(np.arange(len(points)), len(ahead))
    observations = Observations(frame.ravel(), landmark, np.zeros((len(landmark), 2)))
    return Scene(0.1 * np.arange(FRAMES), poses, points, observations)


def street(rng: np.random.Generator, *, uneven: float = 0.0, ground: bool = True, tilt: float = 0.0) -> Scene:
    """Return ground on the lane, its height differing by stretches, and as many landmarks beside it."""
    count = 3 * FRAMES
    foot = rng.integers(0, FRAMES, 2 * count)
    across = np.where(
        np.arange(2 * count) < count, rng.uniform(-2, 2, 2 * count), rng.uniform(-6, 6, 2 * count)
    )
    down = (HEIGHT + np.tan(tilt) * across) * (1.0 + 0.02 * rng.standard_normal(2 * count))
    if uneven:
        down *= np.exp(uneven * rng.standard_normal(FRAMES))[(foot * STEP / (6.0 * HEIGHT)).astype(int)]
    beside = rng.uniform(-5.0, HEIGHT, 2 * count)
    return scene_of(poses_of(), across, np.where(np.arange(2 * count) < count * ground, down, beside), foot)


def scaled(scene: Scene, scale: float) -> Scene:
    """Return the scene in another unit."""
    poses = scene.poses.copy()
    poses[:, :3, 3] *= scale
    return replace(scene, poses=poses, points=scale * scene.points)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_the_height_is_found_in_any_unit_within_its_sigma(scale):
    """Over 20 drives the mean of all stretches lies where their sigmas say, which count the uneven ground."""
    ratio = []
    for seed in range(20):
        ground = measure_heights(scaled(street(np.random.default_rng(seed)), scale))
        assert isinstance(ground, CameraHeights) and len(ground.height) >= 0.8 * ground.stretches
        error = np.log(ground.height / (scale * HEIGHT))
        ratio.append(error / ground.sigma)
        assert np.abs(error).max() < 0.03
    assert np.sqrt(np.mean(np.concatenate(ratio) ** 2)) < 1.3


@pytest.mark.slow
def test_ground_that_is_uneven_is_in_the_sigmas():
    ratio = []
    for seed in range(20):
        ground = measure_heights(street(np.random.default_rng(seed), uneven=0.02))
        assert isinstance(ground, CameraHeights)
        ratio.append(np.log(ground.height / HEIGHT) / ground.sigma)
    assert 0.5 < np.sqrt(np.mean(np.concatenate(ratio) ** 2)) < 1.5


def test_a_drift_of_scale_is_followed():
    scene = street(np.random.default_rng(0))
    growth = np.exp(np.linspace(0.0, 0.4, FRAMES))
    poses = scene.poses.copy()
    steps = np.diff(poses[:, :3, 3], axis=0) * growth[1:, None]
    poses[1:, :3, 3] = np.cumsum(steps, axis=0)
    last = np.zeros(len(scene.points), dtype=int)
    np.maximum.at(last, scene.observations.landmark, scene.observations.frame)
    foot = np.minimum(last + 4, FRAMES - 1)
    points = poses[foot, :3, 3] + growth[foot, None] * (scene.points - scene.poses[foot, :3, 3])
    ground = measure_heights(replace(scene, poses=poses, points=points))
    assert isinstance(ground, CameraHeights)
    middle = (ground.first + ground.last) // 2
    np.testing.assert_allclose(ground.height, HEIGHT * growth[middle], rtol=0.03)


def test_the_frames_of_a_stretch_are_six_heights_apart():
    ground = measure_heights(street(np.random.default_rng(1)))
    assert isinstance(ground, CameraHeights)
    np.testing.assert_allclose(STEP * (ground.last - ground.first), 6.0 * HEIGHT, atol=STEP)


def test_without_a_plane_the_reason_is_said():
    found = measure_heights(street(np.random.default_rng(2), ground=False))
    assert isinstance(found, str) and "lie in a plane in" in found and "stretches only" in found


@pytest.mark.slow
@pytest.mark.parametrize("tilt_deg", [12.0, -17.0, 25.0])
def test_a_camera_that_is_held_askew_has_the_height_square_to_the_ground(tilt_deg):
    tilt = np.radians(tilt_deg)
    for seed in range(5):
        ground = measure_heights(street(np.random.default_rng(seed), tilt=tilt))
        assert isinstance(ground, CameraHeights) and len(ground.height) >= 0.8 * ground.stretches
        assert np.median(ground.height) == pytest.approx(HEIGHT * np.cos(tilt), rel=0.01)


def test_a_camera_that_is_held_too_much_askew_is_said():
    found = measure_heights(street(np.random.default_rng(3), tilt=np.radians(38.0)))
    assert found == "the surface below the camera is tilted by 38 degrees sideways"


def test_a_sky_has_no_ground():
    scene = street(np.random.default_rng(4))
    above = scene.points[:, 2] > 0.0
    scene = replace(scene, points=np.where(above[:, None], scene.points, np.nan))
    assert measure_heights(scene) == "no landmarks lie below the camera where it passes them"


def test_a_camera_that_stands_has_no_ground():
    scene = street(np.random.default_rng(5))
    poses = np.tile(scene.poses[:1], (FRAMES, 1, 1))
    assert isinstance(measure_heights(replace(scene, poses=poses)), str)
