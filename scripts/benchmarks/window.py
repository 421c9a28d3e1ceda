"""Is stage C's window faster and nearer to the truth than iSAM2 and its fixed-lag smoother?

The features of a real run are replayed to all three. They get the same observations, in the same batches: at
every update those of the last ``--length`` frames of each landmark that has been observed three times in them
on rays at least ``--parallax`` apart (on less iSAM2 finds its system indeterminate), and never again once it
has left that window. They get the same fixes, those that the run used, and the same starts: the true motion
with 0.05 deg and 2 cm of noise per frame, landmarks on the first ray at the run's depth with 3 % of noise.
The first two frames are held at their true poses. The error is that of the newest frames' positions against
the recording's truth, right after each update. What differs is what a method does with older frames: stage C
holds them, iSAM2 keeps estimating them, the fixed-lag smoother marginalises them.
"""

import statistics
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, SupportsFloat, SupportsIndex, SupportsInt

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from scripts.common.recordings import true_poses
from scripts.common.stopwatch import stopwatch
from vgps.config import GpsConfig
from vgps.errors import RunFolderError
from vgps.geometry import largest_angle_rad, world_rays
from vgps.gps.fixes import Fixes, fixes_in_world, gps_graph
from vgps.gps.sensors import Sensors
from vgps.model import FloatArray, IntArray
from vgps.readers.run_folder import read_run
from vgps.solution import Solution
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.problem import BundleProblem

SIGMA_PX, ROBUST_K, MIN_VIEWS = 4.0, 0.25, 3


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
        self.fixes: Fixes = fixes.earlier(run.sensors.time_offset_s).where(run.fixes.used)

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


class Method(Protocol):
    """An estimator that takes batches."""

    def update(self, batch: Batch) -> None:
        """Take a batch in."""
        ...

    def pose(self, frame: int) -> gtsam.Pose3:
        """Return the estimate of a frame's pose."""
        ...


class HeldWindow:
    """As stage C: the last frames are optimised, those of a window's length before them are held."""

    def __init__(self, replay: Replay, length: int) -> None:
        self.replay, self.length = replay, length
        self.poses, self.points = replay.true[:1].copy(), replay.points.copy()
        self.rows = np.zeros(0, dtype=np.int64)

    def pose(self, frame: int) -> gtsam.Pose3:
        """See :class:`Method`."""
        return gtsam.Pose3(self.poses[frame])

    def update(self, batch: Batch) -> None:
        """See :class:`Method`."""
        replay, last = self.replay, batch.last
        for frame in range(len(self.poses), last + 1):
            start = replay.true[1] if frame == 1 else replay.start(self.pose(frame - 1), frame).matrix()
            self.poses = np.concatenate([self.poses, start[None]])
        since = max(0, last + 1 - self.length)
        begin = max(0, since - self.length)
        rows = np.concatenate([self.rows, batch.rows])
        self.rows = rows = rows[replay.frame[rows] >= begin]
        used, landmark = np.unique(replay.landmark[rows], return_inverse=True)
        times, lens = replay.t_s[begin : last + 1], replay.camera
        problem = BundleProblem(
            K=(lens.fx, lens.fy, lens.cx, lens.cy),
            world_T_camera=self.poses[begin:],
            world_p_landmark=self.points[used],
            frame=replay.frame[rows] - begin,
            landmark=landmark,
            uv_px=replay.uv[rows],
            sigma_px=np.full(len(rows), SIGMA_PX),
            robust="huber",
            robust_k=np.full(len(rows), ROBUST_K),
            pose_graph=gps_graph(
                replay.fixes.until(times[-1]), times, Sensors.known(replay.antenna), GpsConfig()
            ),
            fixed=np.arange(begin, last + 1) < max(since, 2),
        )
        result = solve(problem, SolverSettings(max_iterations=4, relative_tolerance=1e-5)).problem
        self.poses[begin:], self.points[used] = result.world_T_camera, result.world_p_landmark


class Incremental:
    """iSAM2 over everything, or the fixed-lag smoother around it."""

    def __init__(self, replay: Replay, lag_s: float | None) -> None:
        self.replay = replay
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(0.01)
        parameters.relinearizeSkip = 1
        self.smoother: gtsam.ISAM2 | gtsam.IncrementalFixedLagSmoother = (
            gtsam.ISAM2(parameters) if lag_s is None else gtsam.IncrementalFixedLagSmoother(lag_s, parameters)
        )
        lens = replay.camera
        self.K = gtsam.Cal3_S2(lens.fx, lens.fy, 0.0, lens.cx, lens.cy)
        pixel = gtsam.noiseModel.Isotropic.Sigma(2, SIGMA_PX)
        self.noise = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(ROBUST_K), pixel)
        self.landmarks: set[int] = set()
        self.estimate = gtsam.Values()
        self.fixes_until_s = -1.0

    def pose(self, frame: int) -> gtsam.Pose3:
        """See :class:`Method`."""
        return self.estimate.atPose3(X(frame))

    def update(self, batch: Batch) -> None:
        """See :class:`Method`."""
        replay, graph, values = self.replay, gtsam.NonlinearFactorGraph(), gtsam.Values()
        stamps: dict[SupportsInt | SupportsIndex, SupportsFloat | SupportsIndex] = {}
        for frame in range(batch.first, batch.last + 1):
            values.insert(X(frame), self._start(frame, values if frame > batch.first else self.estimate))
            stamps[X(frame)] = float(replay.t_s[frame])
            if frame < 2:
                tight = gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)
                graph.addPriorPose3(X(frame), gtsam.Pose3(replay.true[frame]), tight)
        for index in batch.rows.tolist():
            landmark, frame = int(replay.landmark[index]), int(replay.frame[index])
            if landmark not in self.landmarks:
                values.insert(L(landmark), replay.points[landmark])
                self.landmarks.add(landmark)
            stamps[L(landmark)] = float(replay.t_s[frame])  # rows of a landmark are in order of time
            keys = X(frame), L(landmark)
            graph.push_back(gtsam.GenericProjectionFactorCal3_S2(replay.uv[index], self.noise, *keys, self.K))
        fixes, last_s = replay.fixes, float(replay.t_s[batch.last])
        new = fixes.where((fixes.t_s > self.fixes_until_s) & (fixes.t_s <= last_s))
        times = replay.t_s[: batch.last + 1]
        graph.push_back(gps_graph(new, times, Sensors.known(replay.antenna), GpsConfig()))
        self.fixes_until_s = last_s
        if isinstance(self.smoother, gtsam.ISAM2):
            self.smoother.update(graph, values)
            self.smoother.update()
        else:
            self.smoother.update(graph, values, stamps)
        self.estimate = self.smoother.calculateEstimate()

    def _start(self, frame: int, before: gtsam.Values) -> gtsam.Pose3:
        if frame < 2:
            return gtsam.Pose3(self.replay.true[frame])
        return self.replay.start(before.atPose3(X(frame - 1)), frame)


@dataclass(frozen=True)
class MethodResult:
    """Seconds and mean position error of the newest frames per update, and why it ended early."""

    seconds: list[float]
    errors_m: list[float]
    failure: str = ""


def run(method: Method, replay: Replay, given: list[Batch]) -> MethodResult:
    """Give a method all batches, and measure."""
    seconds: list[float] = []
    errors_m: list[float] = []
    for batch in given:
        try:
            with stopwatch() as elapsed:
                method.update(batch)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[0][:60]
            return MethodResult(seconds, errors_m, f"failed at frame {batch.last}: {reason}")
        seconds.append(elapsed.wall_s)
        new = range(batch.first, batch.last + 1)
        found = np.array([method.pose(frame).translation() for frame in new])
        errors_m.append(float(np.linalg.norm(found - replay.true[new, :3, 3], axis=1).mean()))
    return MethodResult(seconds, errors_m)


def main() -> None:
    """Print a row for each method."""
    parser = ScriptParser("benchmarks.window", __doc__)
    parser.add_argument("run", type=Path, help="run folder")
    parser.add_argument("--truth", type=Path, help="truth.tum of the run's recording without it")
    parser.add_argument("--frames", type=int, default=300, help="so many of the run's first frames")
    parser.add_argument("--every", type=int, default=15, help="frames per update")
    parser.add_argument("--length", type=int, default=60, help="frames of the window")
    parser.add_argument("--parallax", type=float, default=1.0, help="of a landmark that is used, degrees")
    given = parser.parse_args()
    with parser.refusals():
        results, folder = parser.results(given), read_run(given.run)
        if folder.gps is None:
            raise RunFolderError("has no GPS log", file=given.run, expected="a run with fixes")
        replay = Replay(folder, true_poses(folder, given.run, given.truth)[: given.frames])
    fed = batches(replay, given.every, given.length, float(np.radians(given.parallax)))
    lag_s = float(given.length * np.median(np.diff(replay.t_s)))
    methods: dict[str, Method] = {
        "window, older frames held": HeldWindow(replay, given.length),
        "iSAM2": Incremental(replay, None),
        "iSAM2, fixed lag": Incremental(replay, lag_s),
    }
    observations = sum(len(batch.rows) for batch in fed)
    print(f"{len(replay.true)} frames, {observations} observations\n")
    results.summarise(frames=len(replay.true), observations=observations)
    columns = ("median update [s]", "largest [s]", "last error [m]", "mean error [m]", "")
    table = LiveTable("stage C", *columns)
    for name, method in methods.items():
        result = run(method, replay, fed)
        figures = {}
        if result.seconds:
            figures = {"median_s": statistics.median(result.seconds), "largest_s": max(result.seconds)}
            figures |= {"last_m": result.errors_m[-1], "mean_m": statistics.mean(result.errors_m)}
        results.add(method=name, updates=len(result.seconds), **figures, failure=result.failure)
        cells = [f"{x:.3f}" for x in figures.values()] or [""] * 4
        table.add(name, *cells, result.failure)


if __name__ == "__main__":
    main()
