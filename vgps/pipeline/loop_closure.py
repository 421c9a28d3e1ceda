"""Stage D once more, with the places that its first solution shows to be seen again."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vgps.camera import undistort
from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geometry import world_sigmas
from vgps.gps.fixes import Fixes
from vgps.model import Camera, IntArray
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.readout_estimation import Optimised, optimise_readout
from vgps.pipeline.shown_frames import shown_frames
from vgps.places.loops import Loop, find_loops
from vgps.places.revisits import PosedVideo
from vgps.runtime.progress import Progress
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.scene.rig_views import RigViews
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import Observations


def optimise_loops(
    front_end: FrontEnd, merged: MergedMaps, fixes: Fixes, config: Config, progress: Progress
) -> tuple[Optimised, IntArray]:
    """Optimise everything; once more with the loops that the solution shows, if there are any.

    Returns:
        The solution, and (n, 2) the frames of the loops that it has kept: later frame, earlier frame.

    Raises:
        GeometryError: No step lowers the cost.
    """
    first = optimise_readout(front_end, merged, fixes, config)
    batch, refined, _ = first
    none = np.zeros((0, 2), dtype=np.int64)
    if config.loops.close == "no":
        return first, none
    camera = front_end.recording.camera
    video = _posed_video(batch, refined.camera if refined else camera, merged.scene.rig)
    left_out = np.vstack([front_end.static_regions, front_end.moving_regions])
    frames = shown_frames(front_end.recording, left_out)
    tracked, journal = progress.track(frames, len(front_end.t_s)), front_end.journal
    find = partial(find_loops, video, tracked, config.loops)
    loops = find() if journal is None else journal.step((video.poses, video.points), find, (Loop,))
    if not loops:
        return first, none
    progress.stage("optimising everything again, with places seen again")
    poses, points = batch.trajectory.world_T_camera, batch.points
    scene = with_loops(replace(merged.scene, poses=poses, points=points), loops, camera)
    tied = replace(merged, scene=scene, assessment=batch.assessment)
    try:
        again = optimise_readout(front_end, tied, fixes, config, refined.camera if refined else None)
    except GeometryError:  # the loops contradict the rest so much that no step lowers the cost
        return first, none
    kept = kept_loops(loops, again[0])
    return (again, kept) if len(kept) else (first, none)


def kept_loops(loops: Sequence[Loop], batch: BatchResult) -> IntArray:
    """Return (n, 2) the frames of the loops that an adjustment has kept: later frame, earlier frame."""
    kept = np.unique(batch.loop[batch.loop >= 0]).tolist()
    return np.array([(loops[k].frame, loops[k].earlier) for k in kept], dtype=np.int64).reshape(-1, 2)


def with_loops(scene: Scene, loops: tuple[Loop, ...], camera: Camera) -> Scene:
    """Return the scene with the landmarks of earlier visits observed in the later ones.

    Args:
        scene: Its observations are undistorted by ``camera``.
        loops: The loops.
        camera: As the front end has it.
    """
    old = scene.observations
    counts = [len(loop.landmark) for loop in loops]
    uv_px = undistort(camera, np.concatenate([loop.raw_uv_px for loop in loops]))
    frame = np.repeat([loop.frame for loop in loops], counts)
    landmark = np.concatenate([loop.landmark for loop in loops])
    number = np.repeat(np.arange(len(loops)), counts)
    known = np.unique(old.landmark * len(scene.t_s) + old.frame)
    new = np.isfinite(uv_px).all(axis=1) & ~np.isin(landmark * len(scene.t_s) + frame, known)
    observations = Observations.stacked([old, Observations(frame[new], landmark[new], uv_px[new])])
    of_track = np.full(len(old.frame), -1)
    return replace(scene, observations=observations, loop=np.concatenate([of_track, number[new]]))


def _posed_video(batch: BatchResult, camera: Camera, rig: RigViews | None) -> PosedVideo:
    """Return the solution as the video of the reference camera shows it."""
    poses, seen = batch.trajectory.world_T_camera, batch.observations
    if rig is not None:
        own = rig.camera[seen.landmark] == 0
        seen = seen.rows(own)
    _, sigma_m = world_sigmas(poses, batch.covariance)
    return PosedVideo(
        poses=poses,
        sigma_m=np.asarray(sigma_m.max(axis=1)),
        points=batch.points,
        observations=seen,
        camera=camera,
    )
