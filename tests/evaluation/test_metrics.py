"""Errors against a truth, computed by hand and by evo."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from trajectories import random_walk, trajectory

from vgps.errors import TrajectoryError
from vgps.evaluation import trajectory_errors
from vgps.solution import Trajectory

NO_LEVER = np.zeros(3)


def test_an_offset_is_split_into_horizontal_and_vertical() -> None:
    times = np.arange(5) / 10
    truth = trajectory(times, [0.0, 0.0, 0.0])
    found = trajectory_errors(trajectory(times, [3.0, 4.0, -12.0]), truth, NO_LEVER)
    assert found.camera_position_m.mean == found.camera_position_m.max == 13.0
    assert found.camera_horizontal_m.rmse == 5.0
    assert found.camera_vertical_m.median == 12.0
    assert found.antenna_position_m == found.camera_position_m
    np.testing.assert_array_equal(found.camera_error_m, [[3.0, 4.0, -12.0]] * 5)
    assert found.rotation_deg.max == 0.0


def test_antenna_error_includes_the_rotation_error_times_the_lever_arm() -> None:
    quarter = Rotation.from_euler("z", [[90.0]], degrees=True)
    found = trajectory_errors(
        trajectory(0.0, [0, 0, 0], quarter), trajectory(0.0, [0, 0, 0]), np.array([1.0, 0.0, 2.0])
    )
    assert found.camera_position_m.max == 0.0
    np.testing.assert_allclose(found.antenna_error_m, [[-1.0, 1.0, 0.0]], atol=1e-12)
    assert found.antenna_horizontal_m.mean == pytest.approx(np.sqrt(2))
    assert found.rotation_deg.mean == pytest.approx(90.0)


def test_statistics_by_hand() -> None:
    times = np.arange(3.0)
    found = trajectory_errors(
        trajectory(times, [[0, 0, 0], [3, 0, 0], [0, 0, -4]]), trajectory(times, [0, 0, 0]), NO_LEVER
    )
    spread = found.camera_position_m
    assert spread.mean == pytest.approx(7 / 3)
    assert spread.median == 3.0
    assert spread.rmse == pytest.approx(np.sqrt(25 / 3))
    assert spread.std == pytest.approx(np.sqrt(25 / 3 - 49 / 9))  # about the mean, over N
    assert spread.max == 4.0


@pytest.mark.slow
@given(angle_deg=st.floats(0.0, 180.0), seed=st.integers(0, 100))
def test_rotation_error_is_the_angle_between_the_rotations(angle_deg: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    base = Rotation.random(random_state=rng)
    turned = base * Rotation.from_rotvec(np.radians(angle_deg) * axis / np.linalg.norm(axis))
    found = trajectory_errors(trajectory(0.0, [0, 0, 0], turned), trajectory(0.0, [0, 0, 0], base), NO_LEVER)
    assert found.rotation_error_deg[0] == pytest.approx(angle_deg, abs=1e-6)


def test_a_missing_frame_is_counted() -> None:
    truth = random_walk(1)
    kept = np.arange(40) != 7
    found = trajectory_errors(Trajectory(truth.t_s[kept], truth.world_T_camera[kept]), truth, NO_LEVER)
    assert (found.frames_estimate, found.frames_truth, found.frames_matched) == (39, 40, 39)
    assert not found.every_frame_posed
    assert trajectory_errors(truth, truth, NO_LEVER).every_frame_posed


def test_frames_are_matched_in_time_and_never_interpolated() -> None:
    estimate = trajectory([0.0, 0.1, 0.2, 0.3], [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    truth = trajectory([0.02, 0.12, 0.22], [[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    found = trajectory_errors(estimate, truth, NO_LEVER)
    assert found.camera_position_m.max == 0.0  # the neighbour's own pose, though 0.02 s away
    assert found.largest_gap_s == pytest.approx(0.02)
    assert found.tolerance_s == pytest.approx(0.05)
    assert found.frames_matched == 3
    with pytest.raises(TrajectoryError, match=r"frames at most 0\.01 s apart"):
        trajectory_errors(estimate, truth, NO_LEVER, tolerance_s=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_statistics_and_alignments_agree_with_evo(seed: int) -> None:
    geometry = pytest.importorskip("evo.core.geometry", reason="evo, the oracle, is not installed")
    from evo.core import metrics
    from evo.core.trajectory import PoseTrajectory3D

    truth, noise = random_walk(seed), random_walk(seed + 10)
    poses = truth.world_T_camera.copy()
    poses[:, :3, 3] = 1.3 * poses[:, :3, 3] + 0.1 * noise.world_T_camera[:, :3, 3] + 5
    poses[:, :3, :3] = poses[:, :3, :3] @ noise.world_T_camera[0, :3, :3]
    found = trajectory_errors(Trajectory(truth.t_s, poses), truth, NO_LEVER)
    pair = tuple(
        PoseTrajectory3D(poses_se3=list(matrices), timestamps=truth.t_s)
        for matrices in (truth.world_T_camera, poses)
    )
    for relation, ours in (
        (metrics.PoseRelation.translation_part, found.camera_position_m),
        (metrics.PoseRelation.rotation_angle_deg, found.rotation_deg),
    ):
        ape = metrics.APE(relation)
        ape.process_data(pair)
        theirs = ape.get_all_statistics()
        assert {name: theirs[name] for name in ("mean", "median", "rmse", "std", "max")} == pytest.approx(
            {name: getattr(ours, name) for name in ("mean", "median", "rmse", "std", "max")}
        )
    p, q = poses[:, :3, 3], truth.world_T_camera[:, :3, 3]
    for with_scale, ours in (
        (False, found.camera_position_after_se3_m),
        (True, found.camera_position_after_sim3_m),
    ):
        R, t, c = geometry.umeyama_alignment(p.T, q.T, with_scale)
        left = np.linalg.norm(c * p @ R.T + t - q, axis=1)
        assert ours is not None
        assert (ours.mean, ours.max) == pytest.approx((left.mean(), left.max()))
    assert found.sim3_scale == pytest.approx(c)


def test_nees_by_hand() -> None:
    sigma = np.array([[1.0, 2.0, 3.0], [0.5, 1.0, 1.5], [np.nan] * 3])
    estimate = trajectory(np.arange(3.0), [1.0, 2.0, 3.0])
    truth = trajectory(np.arange(3.0), [0, 0, 0])
    found = trajectory_errors(estimate, truth, NO_LEVER, sigma_position_m=sigma)
    assert found.nees is not None
    assert found.nees.mean == pytest.approx((3 + 12) / 2)  # one sigma on each axis, then two
    assert found.nees.within_95 == 0.5  # 3 is below 7.81, 12 is not
    assert found.nees.frames == 2


def test_nees_is_three_if_the_sigmas_are_right() -> None:
    rng = np.random.default_rng(0)
    sigma = rng.uniform(0.1, 2.0, size=(4000, 3))
    found = trajectory_errors(
        trajectory(np.arange(4000.0), sigma * rng.normal(size=(4000, 3))),
        trajectory(np.arange(4000.0), [0, 0, 0]),
        NO_LEVER,
        sigma_position_m=sigma,
    )
    assert found.nees is not None
    assert found.nees.mean == pytest.approx(3.0, abs=0.15)
    assert found.nees.within_95 == pytest.approx(0.95, abs=0.015)


def test_incomparable_trajectories_are_rejected() -> None:
    truth = random_walk(1)
    with pytest.raises(
        TrajectoryError, match=r"the estimate covers 100\.000 to 103\.900 s, the truth 0\.000 to 3\.900 s"
    ):
        trajectory_errors(Trajectory(truth.t_s + 100, truth.world_T_camera), truth, NO_LEVER)
    with pytest.raises(TrajectoryError, match="the truth has no poses"):
        trajectory_errors(truth, trajectory([], np.zeros((0, 3))), NO_LEVER)
    with pytest.raises(TrajectoryError, match="pose 1: the estimate is not finite"):
        trajectory_errors(trajectory([0.0, 0.1], [[0, 0, 0], [np.nan, 0, 0]]), truth, NO_LEVER)
