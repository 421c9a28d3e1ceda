"""A scene as another calibration sees it: observations undistorted again, poses turned to suit."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.camera import distort, undistort
from vgps.geometry import project, rays
from vgps.model import Camera, FloatArray
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations


def undistorted_again(camera: Camera, before: Camera) -> Callable[[FloatArray], FloatArray]:
    """Return what gives the pinhole pixels (N, 2) of another calibration for those of the one before.

    Where its lens model has no inverse they do not change.
    """

    def undistorted(uv_px: FloatArray) -> FloatArray:
        out, seen = uv_px.copy(), np.isfinite(uv_px).all(axis=1)  # no model is solved for NaN in vain
        new = undistort(camera, distort(before, uv_px[seen]))
        out[seen] = np.where(np.isfinite(new), new, uv_px[seen])
        return out

    return undistorted


def undistorted_by(camera: Camera, before: Camera, scene: Scene) -> Scene:
    """Return the scene with its observations undistorted by another camera, unchanged outside its lens
    model."""
    old, controls = scene.observations, scene.controls
    undistorted = undistorted_again(camera, before)
    observations = Observations(old.frame, old.landmark, undistorted(old.uv_px))
    return replace(
        scene, observations=observations, controls=replace(controls, uv_px=undistorted(controls.uv_px))
    )


def seen_by(camera: Camera, before: Camera, scene: Scene) -> Scene:
    """Return the scene with its observations undistorted by another camera, and its poses turned to suit.

    A centre that moved turns all rays alike: without a turn of the poses hardly an observation would fit.
    """
    seen = undistorted_by(camera, before, scene)
    if not len(seen.observations.frame):
        return seen
    old_rays = rays(before.K, scene.observations.uv_px)
    turn, _ = Rotation.align_vectors(old_rays, rays(camera.K, seen.observations.uv_px))
    poses = scene.poses.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ turn.as_matrix()
    return replace(seen, poses=poses)


def misfit_px(scene: Scene, camera: Camera) -> float:
    """Return the median distance of observations from where their landmarks are seen."""
    seen = scene.observations
    uv_px, depth = project(camera.K, scene.poses[seen.frame], scene.points[seen.landmark, None])
    error = np.linalg.norm(uv_px[:, 0] - seen.uv_px, axis=1)
    return float(np.median(np.where(depth[:, 0] > 0.0, error, np.inf))) if len(error) else 0.0
