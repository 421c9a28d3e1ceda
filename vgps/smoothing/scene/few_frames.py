"""What a rough solution of stage D needs: few of the frames, one round, and frames to hold."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.model import BoolArray
from vgps.smoothing.scene.scene import Scene
from vgps.solver.integer_sets import distinct

MIN_VIEWS = 20  # that are left of few frames


def viewing_frames(scene: Scene) -> int:
    """Return the number of frames with observations."""
    return len(np.unique(scene.observations.frame))


def frame_step(scene: Scene, config: Config) -> int:
    """Return the step between the frames of a rough solution: enough of them are left."""
    return min(config.intrinsics.every_frames, max(viewing_frames(scene) // MIN_VIEWS, 1))


def thinned(scene: Scene, every: int) -> Scene:
    """Return the scene with one in ``every`` of the frames that have observations.

    Most of its tracks end between two of them, where the path is torn no more than before.
    """
    frames = distinct(scene.observations.frame)[::every]
    row_of = np.full(len(scene.t_s), -1)
    row_of[frames] = np.arange(len(frames))
    few = scene.with_observations(row_of[scene.observations.frame] >= 0)
    observations = replace(few.observations, frame=row_of[few.observations.frame])
    crossing = np.minimum.reduceat(scene.crossing_tracks()[: frames[-1]], frames[:-1])
    return Scene(
        scene.t_s[frames], scene.poses[frames], scene.points, observations, loop=few.loop, crossing=crossing
    )


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
