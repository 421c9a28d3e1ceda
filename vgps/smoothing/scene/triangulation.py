"""Features of a scene triangulated from its path."""

from dataclasses import replace

import numpy as np

from vgps.geometry import triangulate
from vgps.model import BoolArray, FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.rig_views import observation_lenses, observation_times
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations


def triangulated(scene: Scene, wanted: BoolArray, context: SmoothingContext, min_views: int) -> Scene:
    """Return the scene with features at the positions that its poses give them.

    Args:
        scene: The scene.
        wanted: (L,) features to triangulate.
        context: Calibration.
        min_views: Observations that a feature needs; one with fewer stays where it is.
    """
    old = scene.observations
    views = np.bincount(old.landmark, minlength=len(scene.points))
    rows = np.flatnonzero((wanted & (views >= min_views))[old.landmark])
    if not len(rows):
        return scene
    rows = rows[np.argsort(old.landmark[rows], kind="stable")]
    seen = old.rows(rows)
    landmark, start = np.unique(seen.landmark, return_index=True)
    points = scene.points.copy()
    poses, uv_px, lens = _views(scene, seen, context)
    points[landmark], _ = triangulate(context.K, poses, uv_px, start, lens=lens)
    return replace(scene, points=points)


def _views(
    scene: Scene, observations: Observations, context: SmoothingContext
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Return the poses (N, 4, 4) of the cameras at the times of observations, their pixels and lenses.

    Pixels (N, 2) of a rig's other cameras are as the reference camera's calibration would have them.
    """
    times = observation_times(scene.t_s, observations, context, scene.rig)
    poses = scene.poses[observations.frame] if times is None else times.poses(scene.poses)
    lens = observation_lenses(observations, context, scene.rig)
    if scene.rig is None:
        return poses, observations.uv_px, lens
    mounts, K = scene.rig.mounts(observations.landmark, context), context.K
    assert mounts.reference_T_camera is not None
    fx, fy, cx, cy = mounts.intrinsics
    scale = np.array([K[0, 0], K[1, 1]]) / np.stack([fx, fy], axis=1)
    uv_px = (observations.uv_px - np.stack([cx, cy], axis=1)) * scale + K[:2, 2]
    lens = None if lens is None else lens / scale[:, None]
    return poses @ mounts.reference_T_camera[mounts.camera], uv_px, lens
