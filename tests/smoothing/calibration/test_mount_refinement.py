"""Poses of cameras on a rig, found from a drive whose truth is known."""

from collections.abc import Iterator
from dataclasses import replace

import gtsam
import numpy as np
import pytest
from synthetic_bundle import TIGHT
from synthetic_rigs import REAR, REAR_K, rig_drive

from vgps.model import Camera, RigCamera
from vgps.smoothing.calibration.camera_equations import mount_jacobian
from vgps.smoothing.calibration.mount_refinement import mount_notes, refine_mounts
from vgps.smoothing.context import RigMount
from vgps.solver.bundle_adjustment import solve
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem

FX, FY, CX, CY = REAR_K
LENS = Camera(model="pinhole", width=640, height=480, fx=FX, fy=FY, cx=CX, cy=CY)
OFF = np.array([0.01, -0.008, 0.012, 0.02, 0.03, -0.02])  # rad, m


def rear(pose: np.ndarray, rotation_sigma: float = 0.02, position_sigma: float = 0.05) -> RigCamera:
    sigma = np.repeat([rotation_sigma, position_sigma], 3)
    return RigCamera(name="rear", video=None, camera=LENS, reference_T_camera=pose, sigma=sigma)  # type: ignore[arg-type]


def mounted(problem: BundleProblem, pose: np.ndarray) -> BundleProblem:
    assert problem.mounts is not None
    mounts = replace(problem.mounts, reference_T_camera=np.stack([np.eye(4), pose]))
    return replace(problem, mounts=mounts)


def retracted(pose: np.ndarray, delta: np.ndarray) -> np.ndarray:
    return gtsam.Pose3(pose).retract(delta).matrix()


def test_jacobians_are_the_derivatives() -> None:
    problem, _ = rig_drive(frames=6, landmarks=30)

    def residuals(pose: np.ndarray) -> np.ndarray:
        there = mounted(problem, pose)
        chunks = linearise(there, all_pose_values(there), analyse_sparsity(there)).chunks
        return np.concatenate([part.r for part in chunks], axis=1)

    linear = linearise(problem, all_pose_values(problem), analyse_sparsity(problem))
    found = np.concatenate([mount_jacobian(part) for part in linear.chunks], axis=2)
    for column, step in enumerate(1e-6 * np.eye(6)):
        slope = (residuals(retracted(REAR, step)) - residuals(retracted(REAR, -step))) / 2e-6
        np.testing.assert_allclose(found[column], slope, atol=1e-3 * max(np.abs(slope).max(), 1.0))


def refined(given: tuple[RigMount, ...], rounds: int, seed: int = 0) -> Iterator[tuple[RigMount, ...]]:
    """Yield the cameras of a drive after each round."""
    problem, _ = rig_drive(frames=30, landmarks=300, seed=seed, noise_px=0.3)
    problem = replace(problem, sigma_px=np.full_like(problem.sigma_px, 0.3))
    cameras, problem = given, mounted(problem, given[0].reference_T_camera)
    for _ in range(rounds):
        problem = solve(problem, TIGHT).problem
        cameras, step = refine_mounts(cameras, problem, given)
        assert step is not None
        yield cameras
        problem = mounted(problem.moved(step.poses, step.points), cameras[0].reference_T_camera)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_camera_that_was_measured_badly_returns_to_its_place(seed: int) -> None:
    given = (rear(retracted(REAR, OFF)),)
    *_, cameras = refined(given, rounds=3, seed=seed)
    error = gtsam.Pose3(REAR).localCoordinates(gtsam.Pose3(cameras[0].reference_T_camera))
    assert (np.abs(error) < 4.0 * cameras[0].sigma).all()
    assert (cameras[0].sigma < given[0].sigma).all()
    assert np.linalg.norm(error[:3]) < 0.3 * np.linalg.norm(OFF[:3])
    (note,) = mount_notes(cameras, given)
    assert note.startswith("the pose of camera rear on the rig was refined by ")


@pytest.mark.slow
def test_further_rounds_pull_no_farther_from_a_place_that_was_measured_well() -> None:
    given = (rear(retracted(REAR, OFF), 0.002, 0.005),)
    first, second = (one.reference_T_camera for (one,) in refined(given, rounds=2))
    way = gtsam.Pose3(REAR).localCoordinates(gtsam.Pose3(first))[:3]
    assert 0.3 < np.linalg.norm(way) / np.linalg.norm(OFF[:3]) < 0.7
    np.testing.assert_allclose(gtsam.Pose3(first).localCoordinates(gtsam.Pose3(second)), 0.0, atol=5e-4)


def test_only_a_change_beyond_chance_is_noted() -> None:
    given, sigma = (rear(REAR),), rear(REAR).sigma
    assert mount_notes((rear(retracted(REAR, 2.5 * sigma)),), given) == ()
    assert len(mount_notes((rear(retracted(REAR, 3.5 * sigma)),), given)) == 1


def test_a_camera_without_standard_deviations_is_held() -> None:
    problem, _ = rig_drive(frames=6, landmarks=30)
    given = (rear(REAR, 0.0, 0.0),)
    assert refine_mounts(given, problem, given) == (given, None)
    assert refine_mounts((), problem, ()) == ((), None)
    assert mount_notes(given, given) == ()
