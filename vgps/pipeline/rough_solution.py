"""Rough solutions of stage D: in one round, of few frames, with or without fixes."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import BoolArray, Camera
from vgps.pipeline.front_end import FrontEnd
from vgps.smoothing.batch import optimise_batch
from vgps.smoothing.batch_result import BatchResult
from vgps.smoothing.factor_graph import Scene
from vgps.smoothing.global_shutter import as_global_shutter
from vgps.smoothing.intrinsics import thinned
from vgps.smoothing.merge_maps import MergedMaps
from vgps.solution import Trajectory

MIN_VIEWS = 20  # that are left of few frames


def optimise_roughly(front_end: FrontEnd, merged: MergedMaps, camera: Camera, config: Config) -> BatchResult:
    """Return a rough solution of stage D in one round with a camera that is held.

    Raises:
        GeometryError: No step lowers the cost.
    """
    held = None if is_tied(front_end, merged, config) else held_frames(merged.scene, config)
    context = replace(
        front_end.context(for_few_frames(config, 1, config.batch.iterations)), camera=camera, rough=True
    )
    fixes, sensors = front_end.fixes, front_end.sensors
    return optimise_batch(merged.scene, fixes, sensors, context, held, merged.assessment)


def video_alone(front_end: FrontEnd, merged: MergedMaps, config: Config) -> Trajectory:
    """Return the path of a rough solution without fixes, IMU and control points.

    Of a single camera one in a few frames is posed.

    Raises:
        GeometryError: No step lowers the cost, or the video does not hold the frames together.
    """
    camera, every = front_end.recording.camera, 1 if front_end.others else frame_step(merged.scene, config)
    scene = replace(merged.scene, controls=NO_CONTROL_OBSERVATIONS, heights=None)
    scene = scene if every == 1 else thinned(as_global_shutter(scene, camera), every)
    front_end = replace(front_end, recording=replace(front_end.recording, imu=None))
    context = front_end.context(for_few_frames(config, every, config.batch.iterations))
    if every > 1:
        camera = replace(camera, readout_s=None)
    unused = replace(front_end.fixes, used=np.zeros_like(front_end.fixes.used))
    context = replace(context, camera=camera, rough=True)
    held = held_frames(scene, config)
    return optimise_batch(scene, unused, front_end.sensors, context, held).trajectory


def is_tied(front_end: FrontEnd, merged: MergedMaps, config: Config) -> bool:
    """Return whether fixes or control points determine place and scale."""
    tied_by_fixes = merged.georeferenced and config.gps.model != "none"
    return tied_by_fixes or len(front_end.controls.frame) > 0


def viewing_frames(scene: Scene) -> int:
    """Return the number of frames with observations."""
    return len(np.unique(scene.observations.frame))


def frame_step(scene: Scene, config: Config) -> int:
    """Return the step between the frames of a rough solution: enough of them are left."""
    return min(config.intrinsics.every_frames, max(viewing_frames(scene) // MIN_VIEWS, 1))


def for_few_frames(config: Config, every: int, iterations: int) -> Config:
    """Return settings for a rough solution in one round; each frame counts for several."""
    batch = config.batch
    changes = {
        "video_sigma_scale": batch.video_sigma_scale / np.sqrt(every),
        "rounds": 1,
        "iterations": iterations,
        "relative_tolerance": batch.early_tolerance,
    }
    gps = config.gps.model_copy(update={"n": 1})
    return config.model_copy(update={"batch": batch.model_copy(update=changes), "gps": gps})


def held_frames(scene: Scene, config: Config) -> BoolArray:
    """Return the frames (F,) to hold, which fix place and, if nothing else gives it, scale."""
    poses = scene.poses
    distance = np.cumsum(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1))
    second = 1 + int(np.searchsorted(distance, config.batch.held_share * distance[-1]))
    held = [0] if scene.heights is not None else [0, min(second, len(poses) - 1)]
    return np.isin(np.arange(len(poses)), held)
