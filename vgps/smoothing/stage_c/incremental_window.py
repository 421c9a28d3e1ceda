"""Stage C by iSAM2: the last frames of a map in a fixed-lag smoother; older ones are a Gaussian prior."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from vgps.errors import GeometryError
from vgps.gps.fixes import Fixes
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import FloatArray
from vgps.smoothing.alignment.drift_correction import moved_points
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.factor_graph import select_observations
from vgps.smoothing.scene.level_priors import level_priors
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_c.fixed_lag import FixedLagGraph, GraphChange
from vgps.smoothing.stage_c.window import WindowResult, optimise_window, start_priors
from vgps.smoothing.stage_c.window_factors import WindowScene, fix_change, frame_change, projection_change

_SAME_POSE = 1e-9  # a map that differs by more was moved by something else than the smoother
# changes beyond which a variable is linearised again: rad, and shares of the median distance of the points
_RELINEARISE_POSE, _RELINEARISE_POINT = 1e-3, 1e-2


class IncrementalWindow:
    """Stage C by iSAM2, which keeps its state from window to window.

    A map that something else has moved (a new one, its alignment, drift correction) is optimised by
    :func:`optimise_window`, and the smoother starts from its result with the next window; likewise where
    iSAM2 fails, where frames have no observations, and with a rolling shutter.

    Args:
        context: Camera, control points and settings.

    Attributes:
        failures: Number of windows in which iSAM2 failed.
    """

    def __init__(self, context: SmoothingContext) -> None:
        self._context = context
        self._graph: FixedLagGraph | None = None
        self._first, self._poses, self._aligned = 0, np.zeros((0, 4, 4)), False
        self.failures = 0

    def optimise(
        self, local_map: LocalMap, fixes: Fixes, camera_p_antenna: FloatArray, tolerance: float = 1.0
    ) -> WindowResult:
        """Optimise the last frames, as :func:`optimise_window` does.

        Fixes that came late, or whose verdicts have changed, enter and leave while their frames are here.

        Raises:
            GeometryError, RuntimeError: See :func:`optimise_window`, where it takes its turn.
        """
        result = None
        if self._knows(local_map) and not self._context.camera.readout_s:
            try:
                result = self._continued(local_map, fixes, camera_p_antenna)
            except (RuntimeError, GeometryError):  # an indeterminate system, or a step to infinity
                self.failures += 1
        if result is None:
            self._graph = None
            result = optimise_window(local_map, fixes, camera_p_antenna, self._context, tolerance)
        poses = result.update.poses if result.converged else None
        self._first, self._aligned = result.update.first_frame, local_map.aligned
        self._poses = np.zeros((0, 4, 4)) if poses is None else poses
        return result

    def _knows(self, local_map: LocalMap) -> bool:
        row = self._first - local_map.first_frame
        if row < 0 or not len(self._poses) or self._aligned != local_map.aligned:
            return False
        now = local_map.poses[row : row + len(self._poses)]
        return len(now) == len(self._poses) and np.allclose(now, self._poses, rtol=0.0, atol=_SAME_POSE)

    def _continued(
        self, local_map: LocalMap, fixes: Fixes, camera_p_antenna: FloatArray
    ) -> WindowResult | None:
        """Return the result of iSAM2; None if it cannot take the new frames in."""
        window = self._window(local_map)
        if window is None:
            return None
        config = self._context.config
        graph = self._graph = self._graph or self._empty_graph(window)
        changes = [
            frame_change(window, self._context),
            projection_change(window, graph, self._context),
        ]
        if local_map.aligned:
            changes.append(fix_change(window, graph, fixes, camera_p_antenna, config.gps))
        if window.starts:
            changes.append(self._start_change(window, local_map.aligned))
        estimate = graph.update(GraphChange.merged(changes), config.window.iterations)
        return _result(estimate, window, graph, local_map)

    def _window(self, local_map: LocalMap) -> WindowScene | None:
        """Return the frames of the window; None if some of the new ones are tied to nothing."""
        newest = local_map.next_frame - 1
        since = max(local_map.first_posed, newest + 1 - self._context.config.window.length_frames)
        begin, new = since, since
        if self._graph is not None:
            begin, new = self._first, self._first + len(self._poses)
        offset = min(max(local_map.first_posed, since - local_map.views.shape[1]), begin)
        scene, ids = scene_of_map(local_map, offset, NO_CONTROL_OBSERVATIONS)
        scene, sigma_px = select_observations(scene, self._context)
        tied = {one.frame for one in scene.zero_motions if one.reference + offset >= begin}
        untied = {one.frame for one in scene.zero_motions} - tied
        if scene.unseen[new - offset :].any() or any(frame + offset >= new for frame in untied):
            return None
        return WindowScene(
            scene=scene,
            feature=ids + local_map.discarded_features,
            sigma_px=sigma_px,
            offset=offset,
            begin=begin,
            since=since,
            new=new,
        )

    def _empty_graph(self, window: WindowScene) -> FixedLagGraph:
        seen, scene = window.scene.observations, window.scene
        to_point = scene.points[seen.landmark] - scene.poses[seen.frame, :3, 3]
        distance = float(np.median(np.linalg.norm(to_point, axis=1)))
        pose = np.repeat([_RELINEARISE_POSE, _RELINEARISE_POSE * distance], 3)
        thresholds = {"x": pose, "l": np.full(3, _RELINEARISE_POINT * distance)}
        return FixedLagGraph(self._context.config.window.length_frames - 1.0, thresholds)

    def _start_change(self, window: WindowScene, aligned: bool) -> GraphChange:
        """Return the priors of a smoother's first window."""
        frames = np.arange(window.since, window.newest + 1)
        graph = gtsam.NonlinearFactorGraph()
        if aligned:
            graph.push_back(level_priors(frames, self._context.config.start))
        if window.offset == window.since:
            tied = aligned and self._context.config.gps.model != "none"
            graph.push_back(start_priors(window.scene.poses, aligned, tied, window.since))
        return GraphChange(factors={("start", k): graph.at(k) for k in range(graph.size())})


def _result(
    estimate: gtsam.Values, window: WindowScene, graph: FixedLagGraph, local_map: LocalMap
) -> WindowResult:
    """Return the estimate; features that the smoother does not have follow the frames that saw them last."""
    poses = np.stack([estimate.atPose3(X(k)).matrix() for k in range(window.since, window.newest + 1)])
    numbers = window.feature.tolist()
    here = np.array([L(number) in graph for number in numbers], dtype=bool) & np.isfinite(window.sigma_px)
    rows = np.flatnonzero(here)
    points = np.array([estimate.atPoint3(L(numbers[row])) for row in rows.tolist()]).reshape(-1, 3)
    if not (np.isfinite(poses).all() and np.isfinite(points).all()):
        raise GeometryError("the estimate of iSAM2 is not finite")
    ids = window.feature[rows] - local_map.discarded_features
    moved = moved_points(local_map, poses, np.ones(len(poses)))
    positions = Positions(ids, points, window.sigma_px[rows]).with_others(moved)
    return WindowResult(MapUpdate(first_frame=window.since, poses=poses, positions=positions), True)
