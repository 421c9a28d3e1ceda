"""The graph of live poses: nodes along the video's path, at fixes, intervals of fixes and places seen again.

The video gives the shape of the path to centimetres over seconds; its scale and rotation drift. A fix is
antenna + offset + noise (:mod:`vgps.gps.offsets`), some time before its time stamp. So a node has position
(3), log scale, rotation (3) of the video's axes, and the receiver's offset (3), and is tied to the one before
it by the video's step, the drift and the walk of the offset. Unlike stage D this takes milliseconds, so that
a fix counts as soon as it comes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import Config
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.offset_errors import between_receivers, mean_errors, step_scale
from vgps.gps.offset_regions import with_offset_regions
from vgps.gps.offsets import OffsetChain, chain_offsets
from vgps.gps.sensors import TimeOffset
from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.online.fusion.live_time_offset import HELD_S
from vgps.online.fusion.node_fixes import SAME_TIME_S, NodeFixes, SeenFixes, node_fixes
from vgps.online.fusion.place_ties import PlaceTies
from vgps.online.fusion.video_path import VideoPath

_NODE_S = 1.5  # longest time between nodes
# Share of the rotation that ``drift`` allows for when fixes are judged. KITTI's visual odometries rotate by
# 0.003 degrees per metre, that is 0.1 degrees while a car moves on by a knot; it is not measured for cameras
# that are carried.
_ROTATION_SHARE = 0.3
_REPLACING_TURN_RAD = 0.35  # a quarter of a usual field of view replaces the features, as a knot does
# Cameras are mounted level to a degree or two, or any way: Cauchy's distribution with 80 % within the sigma.
# About its mean the roll of KITTI's car has 1.1 to 1.5 degrees.
_LEVEL_SHARE, _ROLL_DEVIATION_DEG = 0.3, 2.0
_HELD_M = 1e-3  # least walk of an offset, as between nodes without fixes, and error of a step of the video


@dataclass(frozen=True)
class VideoDrift:
    """Standard deviations (N - 1,) of the video's errors from node to node.

    Attributes:
        scale: Change of log scale.
        rotation: Change of rotation about each axis, radians.
        direction: Error of the step's direction, radians.
    """

    scale: FloatArray
    rotation: FloatArray
    direction: FloatArray

    def step_information(self, step: FloatArray) -> FloatArray:
        """Return the information (N - 1, 3, 3) of steps (N - 1, 3): along them the scale errs, across them
        the direction; drift between two nodes is even but for a twelfth of its variance."""
        length = np.linalg.norm(step, axis=1)
        unit = step / np.maximum(length, 1e-9)[:, None]
        along = length**2 * self.scale**2 / 12.0 + _HELD_M**2
        across = length**2 * (self.rotation**2 / 12.0 + self.direction**2) + _HELD_M**2
        outer = unit[:, :, None] * unit[:, None, :]
        return np.asarray(outer / along[:, None, None] + (np.eye(3) - outer) / across[:, None, None])


def video_drift(poses: FloatArray, frames: FloatArray, bent: FloatArray, config: Config) -> VideoDrift:
    """Return the drift between poses (N, 4, 4) that lie so many moving frames (N - 1,) apart.

    ``bent`` (N - 1,) is the variance, rad^2, that stage C states of their rotation, where it is larger.
    Features pass the scale on to those that replace them, sooner while the camera turns. A wrong focal length
    turns the path by its share of each turn.
    """
    drift, knots = config.drift, np.maximum(frames, 1e-6) / config.drift.knot_frames
    R = poses[:, :3, :3]
    turn = Rotation.from_matrix(R[1:] @ R[:-1].transpose(0, 2, 1)).magnitude()
    replaced = knots + turn / _REPLACING_TURN_RAD
    walk = _ROTATION_SHARE * np.radians(drift.rotation_sigma_deg) * np.sqrt(knots)
    direction = np.radians(drift.rotation_sigma_deg) / np.sqrt(knots)
    rotation = np.hypot(np.sqrt(np.maximum(walk**2, bent)), config.intrinsics.held_focal_sigma * turn)
    return VideoDrift(drift.scale_sigma * np.sqrt(replaced), rotation, np.minimum(direction, 1.0))


@dataclass(frozen=True, kw_only=True)
class FusionNodes:
    """Nodes (N,) and what ties them to each other and to the fixes.

    Attributes:
        t_s: (N,) times.
        camera: (N, 4, 4) poses in the map.
        drift: Errors of the video between them.
        fixes: The fixes.
        ties: Places seen again.
        tied: (K,) nodes of these.
        size_m: (N, 3) standard deviation of offsets of this class; infinite without fixes.
        bound: (N, 3) square roots of the information that the offset is zero.
        walk_m: (N, 3) scale of the offset's step to each node; infinite where it starts anew.
        walk_tail: (N,) degrees of freedom of this step; infinite for a Gaussian.
        starts: (N,) whether a fix there starts a new offset.
        axes: (N, 3, 2) what points to the right and forward of the camera, were it not turned, in the map.
        elevation: (N, 2) sines of the elevation of these axes, but for a bias.
        level: (N, 2) square roots of the information that they are right.
        time_offset: Narrow prior that holds the rest of the time offset.
        mean_roll: Scale (Cauchy) of the bias of the first, the camera's mean roll; infinite if nothing is
            known.
    """

    t_s: FloatArray
    camera: FloatArray
    drift: VideoDrift
    fixes: NodeFixes
    ties: PlaceTies
    tied: IntArray
    size_m: FloatArray
    bound: FloatArray
    walk_m: FloatArray
    walk_tail: FloatArray
    starts: BoolArray
    axes: FloatArray
    elevation: FloatArray
    level: FloatArray
    time_offset: TimeOffset
    mean_roll: float

    def for_sigmas(self, time_offset: TimeOffset) -> "FusionNodes":
        """Return the nodes with another prior of the time offset, for normal equations that give covariances.

        The curvature of Cauchy's density at its peak is that of a Gaussian of a fifth of
        ``start.level_sigma_deg``, as if the camera were surely that level. Here it is that of the whole.
        """
        return replace(self, time_offset=time_offset, mean_roll=self.mean_roll * np.sqrt(2.0) / _LEVEL_SHARE)

    def until(self, node: int) -> "FusionNodes":
        """Return the nodes up to one, with what ties them to each other but nothing on the last itself."""
        rows, ties = slice(0, node + 1), slice(0, node)
        drift, fixes, last = self.drift, self.fixes, np.arange(node + 1) == node
        kept, tied = fixes.node < node, self.tied < node
        return FusionNodes(
            t_s=self.t_s[rows],
            camera=self.camera[rows],
            drift=VideoDrift(drift.scale[ties], drift.rotation[ties], drift.direction[ties]),
            fixes=NodeFixes(**{one.name: getattr(fixes, one.name)[kept] for one in fields(fixes)}),
            ties=self.ties.where(tied),
            tied=self.tied[tied],
            size_m=self.size_m[rows],
            bound=np.where(last[:, None], 0.0, self.bound[rows]),
            walk_m=self.walk_m[rows],
            walk_tail=self.walk_tail[rows],
            starts=self.starts[rows],
            axes=self.axes[rows],
            elevation=self.elevation[rows],
            level=np.where(last[:, None], 0.0, self.level[rows]),
            time_offset=TimeOffset(0.0, np.inf),
            mean_roll=np.inf,
        )


def fusion_nodes(
    path: VideoPath,
    seen: SeenFixes,
    config: Config,
    continued: BoolArray | None = None,
    sizes: Mapping[FixClass, float] | None = None,
) -> FusionNodes:
    """Return the nodes of a path: one for each interval of fixes, others between them, and one at either end.

    Args:
        path: At least two frames.
        seen: Fixes within the path that take part.
        config: Errors of fixes, drift, and the prior of a level camera.
        continued: (M,) which fixes do not start an offset because earlier ones, now forgotten, did.
        sizes: Offsets of classes over the median receiver's, where known.
    """
    fixes = seen.fixes
    chain = chain_offsets(fixes, np.ones(len(fixes), dtype=bool), config.gps) if len(fixes) else _NO_CHAIN
    rows = chain.rows[chain.first]
    starts = chain.starts & ~continued[rows] if continued is not None else chain.starts
    t_s, at, tied = _node_times(path, fixes.t_s[rows])
    camera = path.at(t_s)
    frames = np.diff(np.interp(t_s, path.t_s, np.cumsum(path.moving)))
    first = fixes.where(rows)
    size_m = _offset_sizes(first, config, sizes or {})
    bound = np.sqrt(_times_bounded(first, starts))[:, None] / size_m
    walk_m, tail = _offset_walks(first, starts, config)
    knots = np.diff(t_s, prepend=t_s[0] - _NODE_S) / _NODE_S
    level_rad = np.radians([_ROLL_DEVIATION_DEG, config.start.tilt_sigmas_deg[1]])
    elevation = np.zeros((len(t_s), 2))
    if config.start.flies:  # its pitch is that with which the map was placed
        elevation[:, 1] = camera[:, 2, 2]
    return FusionNodes(
        t_s=t_s,
        camera=camera,
        drift=video_drift(camera, frames, np.diff(path.bent(t_s)), config),
        fixes=node_fixes(seen, camera, at[chain.offset], config),
        ties=path.ties,
        tied=tied,
        size_m=_with_rows(len(t_s), at, size_m, np.inf),
        bound=_with_rows(len(t_s), at, bound, 0.0),
        walk_m=_with_rows(len(t_s), at, walk_m, _HELD_M),
        walk_tail=_with_rows(len(t_s), at, tail, np.inf),
        starts=np.isin(np.arange(len(t_s)), at[starts]),
        axes=camera[:, :3, :3] @ config.start.upright[:, [0, 2]],
        elevation=elevation,
        level=np.sqrt(knots)[:, None] / level_rad,
        time_offset=TimeOffset(seen.rest_s, HELD_S),
        mean_roll=_LEVEL_SHARE * np.radians(config.start.level_sigma_deg),
    )


_NO_CHAIN = OffsetChain(
    rows=np.zeros(0, dtype=np.int64),
    offset=np.zeros(0, dtype=np.int64),
    first=np.zeros(0, dtype=np.int64),
    starts=np.zeros(0, dtype=bool),
)


def _node_times(path: VideoPath, fix_t_s: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the times (N,) of the nodes, and the nodes of fixes and of ties."""
    ends = np.unique(np.concatenate([path.t_s[[0, -1]], fix_t_s, path.ties.t_s]))
    ends = ends[np.append(True, np.diff(ends) > SAME_TIME_S)]
    parts = np.ceil(np.diff(ends) / _NODE_S - 1e-9).astype(np.int64)
    between = [a + (b - a) * np.arange(n) / n for a, b, n in zip(ends, ends[1:], parts, strict=False)]
    t_s = np.concatenate([*between, ends[-1:]])
    at, tied = (np.searchsorted(t_s, one_s - SAME_TIME_S) for one_s in (fix_t_s, path.ties.t_s))
    return t_s, at, tied


def _with_rows(count: int, rows: IntArray, values: FloatArray, others: float) -> FloatArray:
    """Return an array of so many rows that has values in some of them."""
    out = np.full((count, *values.shape[1:]), others)
    out[rows] = values
    return out


def _offset_sizes(first: Fixes, config: Config, sizes: Mapping[FixClass, float]) -> FloatArray:
    """Return the standard deviations (K, 3) of the offsets of fixes' classes.

    A wrong RTK-fix lies as far off as floats of any receiver do, however good this one's are.
    """
    kinds, which = np.unique(first.fix_class, return_inverse=True)
    by_receivers = {
        CLASSES[k]: between_receivers(config.gps.offset_errors(CLASSES[k])) for k in kinds.tolist()
    }
    of_any = np.array(list(by_receivers.values()))[which]
    known = np.array([sizes.get(name, spread) for name, spread in by_receivers.items()])[which]
    size = np.where(first.down_classed, np.maximum(of_any, known), known)
    return size[:, None] * region_sigmas(with_offset_regions(first, config.gps))


def _times_bounded(first: Fixes, starts: BoolArray) -> FloatArray:
    """Return how often (K,) offsets are bounded: a stretch once, and again for every correlation time."""
    since_s = np.diff(first.t_s, prepend=first.t_s[:1])
    return np.where(starts, 1.0, np.minimum(since_s / first.correlation_s, 1.0))


def _offset_walks(first: Fixes, starts: BoolArray, config: Config) -> tuple[FloatArray, FloatArray]:
    """Return scale (K, 3) and tail (K,) of the walk to each offset, those of the mean over receivers."""
    errors = mean_errors(first, config.gps)
    scale = step_scale(errors, np.diff(first.t_s, prepend=first.t_s[:1] - 1.0))
    walk_m = np.maximum(scale, _HELD_M)
    walk_m = np.stack([walk_m, walk_m, errors.vertical * walk_m], axis=1)
    return np.where(starts[:, None], np.inf, walk_m), np.where(starts, np.inf, errors.tail)
