"""Observations of a rolling shutter as a global one would have made them, by the path as it is."""

from dataclasses import replace

import numpy as np

from vgps.geometry import MIN_DEPTH, project
from vgps.model import Camera
from vgps.smoothing.scene.row_times import row_times
from vgps.smoothing.scene.scene import Scene


def as_global_shutter(scene: Scene, camera: Camera) -> Scene:
    """Return the scene with observations that belong to the frames' times, whatever their rows.

    Each observation moves by as much as its landmark does from the row's pose to that of the frame. The path
    is drawn through all frames; with this a calibration needs few of them.

    Args:
        scene: All frames.
        camera: The camera.
    """
    observations = scene.observations
    times = row_times(scene.t_s, observations.frame, observations.uv_px, camera)
    if times is None:
        return scene
    points = scene.points[observations.landmark][:, None]
    by_row, row_depth = project(camera.K, times.poses(scene.poses), points)
    by_frame, depth = project(camera.K, scene.poses[observations.frame], points)
    ahead = (row_depth > MIN_DEPTH) & (depth > MIN_DEPTH)
    moved = np.where(ahead, (by_frame - by_row)[:, 0], 0.0)
    return replace(scene, observations=replace(observations, uv_px=observations.uv_px + moved))
