"""The maps of all cameras before stage D, and after it, camera by camera."""

import numpy as np

from vgps.pipeline.front_end import FrontEnd
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.merging.merge_cameras import CameraMaps, merge_cameras
from vgps.smoothing.merging.merge_maps import MergedMaps, merge_maps
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import Landmarks, Observations, SolvedCamera


def merged_maps(front_end: FrontEnd, context: SmoothingContext) -> MergedMaps:
    """Return the maps of all cameras in one world."""
    if not front_end.others:
        return merge_maps(front_end.maps, front_end.t_s, front_end.fixes, front_end.sensors, context)
    own = CameraMaps(front_end.maps, front_end.t_s, front_end.sensors, "of the recording")
    return merge_cameras((own, *front_end.others), front_end.fixes, context)


def solved_map(merged: MergedMaps, batch: BatchResult, camera: int = 0) -> tuple[Landmarks, Observations]:
    """Return the features that a camera of a rig observes, by default the reference, and its observations."""
    rig, known = merged.scene.rig, np.isfinite(batch.sigma_px)
    kept = np.flatnonzero(known if rig is None else known & (rig.camera == camera))
    row_of = np.full(len(batch.points), -1)
    row_of[kept] = np.arange(len(kept))
    old = batch.observations
    row = row_of[old.landmark]
    own = row >= 0
    return (
        Landmarks(batch.points[kept], batch.sigma_px[kept], merged.gray[kept]),
        Observations(old.frame[own], row[own], old.uv_px[own]),
    )


def solved_cameras(front_end: FrontEnd, merged: MergedMaps, batch: BatchResult) -> tuple[SolvedCamera, ...]:
    """Return the other cameras of a rig with their maps."""
    rig = merged.scene.rig
    if rig is None:
        return ()
    cameras = []
    for k, (given, refined) in enumerate(zip(front_end.recording.cameras, batch.cameras, strict=True), 1):
        landmarks, observations = solved_map(merged, batch, k)
        cameras.append(
            SolvedCamera(
                name=given.name,
                camera=given.camera,
                reference_T_camera=refined.reference_T_camera,
                sigma=refined.sigma,
                delay_s=rig.delay_s[k],
                landmarks=landmarks,
                observations=observations,
            )
        )
    return tuple(cameras)
