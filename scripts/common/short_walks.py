"""Simulated walks of some seconds, and the errors of a run over its standard deviations."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.evaluation import match_times
from vgps.model import FloatArray
from vgps.simulate import SCENES, SceneConfig
from vgps.solution import Solution, Trajectory


class Ratios(NamedTuple):
    """Errors over their standard deviations, (F, 3) each: positions east, north, up; rotations about them."""

    seed: int
    position: FloatArray
    rotation: FloatArray
    position_m: float
    rotation_deg: float


def short_walk(seconds: float, fix_share: float, roll_deg: float = 0.0) -> SceneConfig:
    """Return a walk round a corner in small pictures."""
    return replace(
        SCENES["demo"],
        speed=((0.0, 1.2), (seconds, 1.2)),
        width=360,
        height=240,
        focal_px=310.0,
        texture_scale=0.5,
        roll_deg=roll_deg,
        gps=replace(SCENES["demo"].gps, fix_share=fix_share),
    )


def ratios(seed: int, solution: Solution, truth: Trajectory) -> Ratios:
    """Return the errors of poses over their standard deviations, frame by frame, in world axes."""
    e, t = match_times(solution.t_s, truth.t_s, 1e-3)
    found, true = solution.world_T_camera[e], truth.world_T_camera[t]
    position = found[:, :3, 3] - true[:, :3, 3]
    rotation = Rotation.from_matrix(found[:, :3, :3] @ true[:, :3, :3].transpose(0, 2, 1))
    return Ratios(
        seed,
        position / solution.sigma_position_m[e],
        rotation.as_rotvec() / solution.sigma_rotation_rad[e],
        float(np.linalg.norm(position, axis=1).mean()),
        float(np.degrees(rotation.magnitude()).mean()),
    )
