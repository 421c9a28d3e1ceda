"""When and from where the cameras of a rig observe: hand-computed times, points found again."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_rigs import REAR, REAR_K, rig_drive

from vgps.config import Config
from vgps.model import Camera, RigCamera
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.merging.merge_cameras import frames_of
from vgps.smoothing.scene.rig_views import RigViews, observation_times
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.scene.triangulation import triangulated
from vgps.solution import Observations

LENS = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.0, cy=240.0)
REAR_LENS = replace(LENS, **dict(zip(("fx", "fy", "cx", "cy"), REAR_K, strict=True)))


def context(reference: Camera = LENS, rear: Camera = REAR_LENS) -> SmoothingContext:
    camera = RigCamera(name="rear", video=None, camera=rear, reference_T_camera=REAR, sigma=np.zeros(6))  # type: ignore[arg-type]
    return SmoothingContext(reference, Config(), cameras=(camera,))


def test_a_camera_that_exposes_later_and_rolls_has_times_of_its_own() -> None:
    delay_s = np.array([[0.0, 0.0, 0.0], [0.01, 0.02, 0.0]])
    views = RigViews(np.array([0, 1]), delay_s)
    observations = Observations(np.array([0, 0, 1]), np.array([0, 1, 1]), np.array([[0.0, 479.0]] * 3))
    t_s = np.array([0.0, 0.1, 0.2])
    times = observation_times(t_s, observations, context(rear=replace(REAR_LENS, readout_s=0.03)), views)
    assert times is not None
    later_s = times.frame_s + times.readout_s * times.share - t_s[observations.frame]
    np.testing.assert_allclose(later_s, [0.0, 0.01 + 0.015, 0.02 + 0.015])


def test_cameras_that_expose_together_need_no_times() -> None:
    views = RigViews(np.array([0, 1]), np.zeros((2, 3)))
    observations = Observations(np.array([0, 1]), np.array([0, 1]), np.zeros((2, 2)))
    assert observation_times(np.arange(3.0), observations, context(), views) is None


def test_features_of_both_cameras_are_triangulated_on_one_path() -> None:
    problem, truth = rig_drive(frames=12, landmarks=60, noise_px=0.0)
    seen = Observations(problem.frame, problem.landmark, problem.uv_px)
    views = RigViews(np.arange(60) % 2, np.zeros((2, 12)))
    start = np.zeros_like(problem.world_p_landmark)
    scene = Scene(0.1 * np.arange(12), truth, start, seen, rig=views)
    found = triangulated(scene, np.arange(60) < 59, context(), 3).points
    many = (np.bincount(problem.landmark, minlength=60) >= 3) & (np.arange(60) < 59)
    assert many.sum() > 30 and not found[~many].any()
    assert np.abs(found[many] - problem.world_p_landmark[many]).max() < 2.0  # which are off by 0.3 m each
    again = triangulated(replace(scene, points=found), many, context(), 3).points
    np.testing.assert_array_equal(again, found)


@pytest.mark.parametrize(
    ("own_s", "expected"),
    [
        ([0.0, 0.1, 0.2, 0.3], [0, 1, 2, 3]),  # in step
        ([0.04, 0.14, 0.24], [0, 1, 2]),  # 40 ms late
        ([0.0, 0.05, 0.1, 0.15, 0.2], [0, -1, 1, -1, 2]),  # twice as many
        ([0.1, 0.3], [1, 3]),  # half as many
        ([-0.5, 0.0, 0.9], [-1, 0, -1]),  # longer than the reference
    ],
)
def test_each_frame_of_the_reference_gets_at_most_the_nearest_of_another_camera(own_s, expected) -> None:
    t_s = np.array([0.0, 0.1, 0.2, 0.3])
    assert frames_of(np.array(own_s), t_s).tolist() == expected
