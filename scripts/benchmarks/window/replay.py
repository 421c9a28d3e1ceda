"""A run replayed: the batches that every method gets, the truth, and starts that are somewhat wrong."""

from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.config import GpsConfig
from vgps.geometry import largest_angle_rad, world_rays
from vgps.gps.fixes import Fixes, fixes_in_world
from vgps.model import FloatArray, IntArray
from vgps.solution import Solution

MIN_VIEWS = 3


class Replay:
    """A run's observations and fixes, the truth, and starts that are somewhat wrong.

    Args:
        run: With a GPS log; its first frames are replayed.
        true: (F, 4, 4) true poses of these frames, in the run's world.
    """

    def __init__(self, run: Solution, true: FloatArray) -> None:
        rng, frames = np.random.default_rng(0), len(true)
        observations = run.observations
        rows = np.flatnonzero(observations.frame < frames)
        rows = rows[np.lexsort((observations.frame[rows], observations.landmark[rows]))]
        self.frame, self.landmark = observations.frame[rows], observations.landmark[rows]
        self.uv, self.camera, self.antenna = observations.uv_px[rows], run.camera, run.camera_p_antenna
        self.t_s, self.true = run.t_s[:frames], true
        self.rays = world_rays(run.camera.K, true[self.frame], self.uv)
        noise = rng.normal(0.0, 1.0, (frames, 6)) * np.radians([0.05] * 3 + [0.0] * 3)
        noise[:, 3:] = rng.normal(0.0, 0.02, (frames, 3))
        self.noise = noise
        self.points = self._starts(run, 1.0 + rng.normal(0.0, 0.03, len(run.landmarks.sigma_px)))
        assert run.gps is not None and run.fixes is not None
        fixes = fixes_in_world(run.gps, run.fixes.world_p_fix, GpsConfig())
        self.fixes: Fixes = fixes.without_time_offset(run.sensors.time_offset_s).where(run.fixes.used)

    def _starts(self, run: Solution, scale: FloatArray) -> FloatArray:
        """Return (L, 3) landmarks on their first ray from the true pose, at the run's distance, scaled."""
        points = run.landmarks.world_p_landmark.copy()
        landmark, first = np.unique(self.landmark, return_index=True)
        frame = self.frame[first]
        distance = np.linalg.norm(points[landmark] - run.world_T_camera[frame, :3, 3], axis=1)
        away = (distance * scale[landmark])[:, None] * self.rays[first]
        points[landmark] = self.true[frame, :3, 3] + away
        return points

    def start(self, before: gtsam.Pose3, frame: int) -> gtsam.Pose3:
        """Return the start of a frame's pose from the estimate of the frame before."""
        a, b = gtsam.Pose3(self.true[frame - 1]), gtsam.Pose3(self.true[frame])
        return before.compose(a.between(b)).compose(gtsam.Pose3.Expmap(self.noise[frame]))


@dataclass(frozen=True)
class Batch:
    """What an update brings: frames ``first`` to ``last``, and (N,) rows of the replay's observations."""

    first: int
    last: int
    rows: IntArray


def batches(replay: Replay, every: int, length: int, parallax_rad: float) -> list[Batch]:
    """Return the batches that every method gets.

    Args:
        replay: What is replayed.
        every: Frames per update.
        length: Frames of the window.
        parallax_rad: A landmark is given once its rays in the window differ by this.
    """
    given = np.zeros(len(replay.frame), dtype=bool)
    newest = np.full(len(replay.points), -1)  # frame of each landmark's last observation given
    found = []
    for first in range(0, len(replay.true), every):
        last, begin = min(first + every, len(replay.true)) - 1, min(first + every, len(replay.true)) - length
        recent = np.flatnonzero((replay.frame >= begin) & (replay.frame <= last))
        landmark, start, views = np.unique(replay.landmark[recent], return_index=True, return_counts=True)
        ready = (views >= MIN_VIEWS) & (largest_angle_rad(replay.rays[recent], start) >= parallax_rad)
        known = newest[landmark] >= 0
        wanted = landmark[np.where(known, newest[landmark] >= begin, ready)]
        rows = recent[~given[recent] & np.isin(replay.landmark[recent], wanted)]
        given[rows] = True
        np.maximum.at(newest, replay.landmark[rows], replay.frame[rows])
        found.append(Batch(first, last, rows))
    return found
