"""Stage C three ways on the features of a real run: our window, iSAM2, and iSAM2 with a fixed lag.

All three get the same observations, fixes and starts: the run's own motion with 0.05 deg and 2 cm of noise a
frame, points 3 % off in depth. The error is that of the newest frames' positions against the run's, right
after each update.
"""

import argparse
import statistics
import time
from pathlib import Path
from typing import Protocol

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from vgps.config import GpsConfig
from vgps.gps.fixes import Fixes, fixes_in_world, gps_graph
from vgps.gps.sensors import Sensors
from vgps.model import FloatArray, IntArray
from vgps.readers.run_folder import read_run
from vgps.solution import Solution
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.problem import BundleProblem

SIGMA_PX, ROBUST_K, MIN_VIEWS = 4.0, 0.25, 3


class World:
    """A run replayed: its observations, and starts that are somewhat wrong."""

    def __init__(self, run: Solution, frames: int) -> None:
        rng = np.random.default_rng(0)
        seen = run.observations
        rows = np.flatnonzero(seen.frame < frames)
        rows = rows[np.argsort(seen.frame[rows], kind="stable")]
        self.frame, self.landmark, self.uv = seen.frame[rows], seen.landmark[rows], seen.uv_px[rows]
        self.camera, self.antenna, self.t_s = run.camera, run.camera_p_antenna, run.t_s[:frames]
        self.true = run.world_T_camera[:frames]
        noise = rng.normal(0.0, 1.0, (frames, 6)) * np.radians([0.05] * 3 + [0.0] * 3)
        noise[:, 3:] = rng.normal(0.0, 0.02, (frames, 3))
        self.noise = noise
        first = np.zeros(len(run.landmarks.world_p_landmark), dtype=np.int64)
        first[self.landmark[::-1]] = self.frame[::-1]
        eye = run.world_T_camera[first, :3, 3]
        depth = 1.0 + rng.normal(0.0, 0.03, len(first))
        self.points = eye + depth[:, None] * (run.landmarks.world_p_landmark - eye)
        assert run.gps is not None and run.fixes is not None
        self.fixes: Fixes = fixes_in_world(run.gps, run.fixes.world_p_fix, GpsConfig())

    def step(self, estimate: gtsam.Pose3, frame: int) -> gtsam.Pose3:
        """Where the next frame seems to be."""
        a, b = gtsam.Pose3(self.true[frame - 1]), gtsam.Pose3(self.true[frame])
        return estimate.compose(a.between(b)).compose(gtsam.Pose3.Expmap(self.noise[frame]))

    def ready(self, first: int, last: int) -> IntArray:
        """Observations in frames first..last of points that have been seen often enough by then."""
        views = np.bincount(self.landmark[self.frame <= last], minlength=len(self.points))
        rows = (self.frame >= first) & (self.frame <= last) & (views[self.landmark] >= MIN_VIEWS)
        return np.flatnonzero(rows)

    def parallax(self, last: int) -> FloatArray:
        """(L,) angle between the rays of a point's first observation and its newest so far, radians."""
        rows = self.frame <= last
        newest, first = np.zeros(len(self.points), dtype=np.int64), np.zeros(len(self.points), dtype=np.int64)
        newest[self.landmark[rows]] = self.frame[rows]
        first[self.landmark[rows][::-1]] = self.frame[rows][::-1]
        rays = [self.points - self.true[frame, :3, 3] for frame in (first, newest)]
        a, b = (ray / np.linalg.norm(ray, axis=1, keepdims=True) for ray in rays)
        return np.arcsin(np.clip(np.linalg.norm(np.cross(a, b), axis=1), 0.0, 1.0))


class Window(Protocol):
    """Something that keeps poses up to date."""

    def update(self, first_new: int, last: int) -> None:
        """Take frames first_new..last in."""
        ...

    def pose(self, frame: int) -> gtsam.Pose3:
        """The estimate."""
        ...


class Held:
    """Ours: the last frames solved anew, older ones held."""

    def __init__(self, world: World, length: int) -> None:
        self.world, self.length = world, length
        self.poses, self.points = world.true[:1].copy(), world.points.copy()

    def pose(self, frame: int) -> gtsam.Pose3:
        """See :class:`Window`."""
        return gtsam.Pose3(self.poses[frame])

    def update(self, first_new: int, last: int) -> None:
        """See :class:`Window`."""
        world = self.world
        for frame in range(len(self.poses), last + 1):
            start = world.step(self.pose(frame - 1), frame).matrix()
            self.poses = np.concatenate([self.poses, start[None]])
        since = max(0, last + 1 - self.length)
        begin = max(0, since - self.length)
        rows = world.ready(begin, last)
        used, landmark = np.unique(world.landmark[rows], return_inverse=True)
        fixed = np.arange(begin, last + 1) < max(since, 2)
        lens = world.camera
        times = world.t_s[begin : last + 1]
        graph = gps_graph(world.fixes.until(times[-1]), times, Sensors.known(world.antenna), GpsConfig())
        n = len(rows)
        problem = BundleProblem(
            K=(lens.fx, lens.fy, lens.cx, lens.cy),
            world_T_camera=self.poses[begin:],
            world_p_landmark=self.points[used],
            frame=world.frame[rows] - begin,
            landmark=landmark,
            uv_px=world.uv[rows],
            sigma_px=np.full(n, SIGMA_PX),
            robust="huber",
            robust_k=np.full(n, ROBUST_K),
            pose_graph=graph,
            fixed=fixed,
        )
        result = solve(problem, SolverSettings(max_iterations=4, relative_tolerance=1e-5)).problem
        self.poses[begin:], self.points[used] = result.world_T_camera, result.world_p_landmark


class Incremental:
    """iSAM2 over everything, or the fixed-lag smoother around it.

    Points join once their parallax is large enough: on smaller ones iSAM2 finds its system indeterminate.
    """

    def __init__(self, world: World, lag_s: float | None, parallax: float) -> None:
        self.world, self.lag_s, self.parallax = world, lag_s, parallax
        parameters = gtsam.ISAM2Params()
        parameters.setRelinearizeThreshold(0.01)
        parameters.relinearizeSkip = 1
        if lag_s is None:
            self.smoother = gtsam.ISAM2(parameters)
        else:
            self.smoother = gtsam.IncrementalFixedLagSmoother(lag_s, parameters)
        lens = world.camera
        self.K = gtsam.Cal3_S2(lens.fx, lens.fy, 0.0, lens.cx, lens.cy)
        pixel = gtsam.noiseModel.Isotropic.Sigma(2, SIGMA_PX)
        self.noise = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(ROBUST_K), pixel)
        self.known: dict[int, int] = {}  # landmark: frame in which it was last seen
        self.done: set[int] = set()  # rows that are in the graph
        self.estimate = gtsam.Values()
        self.fixed_until = -1.0

    def pose(self, frame: int) -> gtsam.Pose3:
        """See :class:`Window`."""
        return self.estimate.atPose3(X(frame))

    def update(self, first_new: int, last: int) -> None:
        """See :class:`Window`."""
        world, graph, values, stamps = self.world, gtsam.NonlinearFactorGraph(), gtsam.Values(), {}
        for frame in range(first_new, last + 1):
            if frame == 0:
                start = gtsam.Pose3(world.true[0])
            else:
                before = values if frame > first_new else self.estimate
                start = world.step(before.atPose3(X(frame - 1)), frame)
            values.insert(X(frame), start)
            stamps[X(frame)] = float(world.t_s[frame])
            if frame < 2:
                tight = gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)
                graph.addPriorPose3(X(frame), gtsam.Pose3(world.true[frame]), tight)
        oldest = 0 if self.lag_s is None else int(np.searchsorted(world.t_s, world.t_s[last] - self.lag_s))
        wide = world.parallax(last) >= self.parallax
        for row in world.ready(oldest, last).tolist():
            landmark, frame = int(world.landmark[row]), int(world.frame[row])
            if row in self.done or (landmark in self.known and self.known[landmark] < oldest):
                continue
            if landmark not in self.known and not wide[landmark]:
                continue
            if landmark not in self.known:
                values.insert(L(landmark), world.points[landmark])
            self.known[landmark] = max(frame, self.known.get(landmark, 0))
            stamps[L(landmark)] = float(world.t_s[self.known[landmark]])
            self.done.add(row)
            graph.push_back(
                gtsam.GenericProjectionFactorCal3_S2(world.uv[row], self.noise, X(frame), L(landmark), self.K)
            )
        new = (world.fixes.t_s > self.fixed_until) & (world.fixes.t_s <= world.t_s[last])
        sensors, times = Sensors.known(world.antenna), world.t_s[: last + 1]
        graph.push_back(gps_graph(world.fixes.where(new), times, sensors, GpsConfig()))
        self.fixed_until = float(world.t_s[last])
        if self.lag_s is None:
            self.smoother.update(graph, values)
            self.smoother.update()
        else:
            self.smoother.update(graph, values, stamps)
        self.estimate = self.smoother.calculateEstimate()


def replay(window: Window, world: World, every: int) -> tuple[list[float], list[float], str]:
    """StageTimer and errors per update, and what went wrong."""
    seconds, errors = [], []
    for first in range(0, len(world.true), every):
        last = min(first + every, len(world.true)) - 1
        begun = time.perf_counter()
        try:
            window.update(first, last)
        except RuntimeError as error:
            return seconds, errors, f"failed at frame {last}: {str(error).strip().splitlines()[0][:60]}"
        seconds.append(time.perf_counter() - begun)
        found = np.array([window.pose(frame).translation() for frame in range(first, last + 1)])
        errors.append(float(np.linalg.norm(found - world.true[first : last + 1, :3, 3], axis=1).mean()))
    return seconds, errors, ""


def main() -> None:
    """Print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--every", type=int, default=15)
    parser.add_argument("--length", type=int, default=60)
    parser.add_argument("--parallax", type=float, default=1.0, help="degrees, for iSAM2 alone")
    given = parser.parse_args()
    parallax = float(np.radians(given.parallax))
    world = World(read_run(given.run), given.frames)
    lag_s = float(given.length * np.median(np.diff(world.t_s)))
    contestants: dict[str, Window] = {
        "window, older held": Held(world, given.length),
        "iSAM2": Incremental(world, None, parallax),
        "iSAM2, fixed lag": Incremental(world, lag_s, parallax),
    }
    print("| stage C | median s | largest s | last error [m] | mean error [m] | |\n|---|---|---|---|---|---|")
    for name, window in contestants.items():
        seconds, errors, trouble = replay(window, world, given.every)
        if not seconds:
            print(f"| {name} | | | | | {trouble} |")
            continue
        figures = [statistics.median(seconds), max(seconds), errors[-1], statistics.mean(errors)]
        print(f"| {name} | " + " | ".join(f"{x:.3f}" for x in figures) + f" | {trouble} |", flush=True)


if __name__ == "__main__":
    main()
