"""Rough solutions of stage D: in one round, of few frames, with or without fixes."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import Camera
from vgps.pipeline.front_end import FrontEnd
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.scene.few_frames import for_few_frames, frame_step, held_frames, thinned
from vgps.smoothing.scene.global_shutter import as_global_shutter
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import Trajectory


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
