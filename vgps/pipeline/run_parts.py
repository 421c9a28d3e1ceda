"""The joint adjustment of several runs, taken apart into runs again."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vgps.camera import in_pinhole
from vgps.geometry import world_sigmas
from vgps.gps.antenna_path import antenna_at, place
from vgps.model import BoolArray, ControlPoints, FloatArray
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.smoothing.stage_d.joint_scene import JointScene
from vgps.solution import FixTable, Landmarks, Observations, Solution


def all_landmarks(runs: Sequence[Solution], batch: BatchResult) -> tuple[Landmarks, Observations]:
    """Return all landmarks of the adjustment; frames are counted through all runs."""
    return _landmarks(runs, batch, np.ones(len(batch.observations.frame), dtype=bool))


def part_of_run(
    runs: Sequence[Solution], number: int, joint: JointScene, batch: BatchResult, notes: tuple[str, ...]
) -> Solution:
    """Return one of the runs as the joint adjustment gives it, in the world of the first.

    Args:
        runs: The runs before.
        number: The one.
        joint: All of them as one scene.
        batch: Its adjustment.
        notes: Warnings of the adjustment.
    """
    run, camera = runs[number], runs[number].camera
    frames = slice(int(joint.frames[number]), int(joint.frames[number + 1]))
    poses = batch.trajectory.world_T_camera[frames]
    rotation_sigma, position_sigma = world_sigmas(poses, batch.covariance[frames])
    mine = (batch.observations.frame >= frames.start) & (batch.observations.frame < frames.stop)
    landmarks, observations = _landmarks(runs, batch, mine)
    own_pixels = in_pinhole(observations.uv_px, joint.camera, camera)
    scale = camera.fx / joint.camera.fx
    first_T_run = joint.world_T_runs[number]
    return replace(
        run,
        world_origin=runs[0].world_origin,
        world_T_camera=poses,
        sigma_rotation_rad=rotation_sigma,
        sigma_position_m=position_sigma,
        landmarks=replace(landmarks, sigma_px=scale * landmarks.sigma_px),
        observations=Observations(observations.frame - frames.start, observations.landmark, own_pixels),
        fixes=_fix_table(run, poses, first_T_run),
        control_points=_moved_points(run.control_points, first_T_run),
        world_p_before=joint.scene.poses[frames, :3, 3].copy(),
        report=batch.report,
        warnings=(*run.warnings, *notes),
        graph=None,
    )


def _landmarks(
    runs: Sequence[Solution], batch: BatchResult, mask: BoolArray
) -> tuple[Landmarks, Observations]:
    """Return the landmarks of some observations (N,), and these observations of them."""
    old = batch.observations
    kept, landmark = np.unique(old.landmark[mask], return_inverse=True)
    gray = np.concatenate([one.landmarks.gray for one in runs])
    return (
        Landmarks(batch.points[kept], batch.sigma_px[kept], gray[kept]),
        Observations(old.frame[mask], landmark, old.uv_px[mask]),
    )


def _fix_table(run: Solution, poses: FloatArray, first_T_run: FloatArray) -> FixTable | None:
    """Return the verdicts of a run with its fixes in the joint world, and the antenna's offsets from them."""
    if run.fixes is None:
        return None
    position = run.fixes.world_p_fix @ first_T_run[:3, :3].T + first_T_run[:3, 3]
    placement = place(run.t_s, run.fix_times_s)
    residual = antenna_at(poses, placement, run.camera_p_antenna) - position
    residual[~placement.inside] = np.nan
    return replace(run.fixes, world_p_fix=position, residual_m=residual)


def _moved_points(points: ControlPoints | None, first_T_run: FloatArray) -> ControlPoints | None:
    if points is None or points.geodetic:
        return points
    moved = points.world_p_point @ first_T_run[:3, :3].T + first_T_run[:3, 3]
    return replace(points, world_p_point=moved)
