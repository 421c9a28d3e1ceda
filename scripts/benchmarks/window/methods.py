"""The methods compared: stage C's window, iSAM2, and iSAM2 with a fixed lag."""

from typing import Protocol, SupportsFloat, SupportsIndex, SupportsInt

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from scripts.benchmarks.window.replay import Batch, Replay
from vgps.config import GpsConfig
from vgps.gps.fixes import gps_graph
from vgps.gps.sensors import Sensors
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.problem import BundleProblem

SIGMA_PX, ROBUST_K = 4.0, 0.25


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
                replay.fixes.until(times[-1]), times, Sensors.fixed(replay.antenna), GpsConfig()
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
        graph.push_back(gps_graph(new, times, Sensors.fixed(replay.antenna), GpsConfig()))
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
