"""Where the video sees the fixes, and what ties them to nodes (:mod:`vgps.online.fusion.fusion_nodes`)."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.gps.fixes import Fixes
from vgps.gps.offset_errors import mean_errors, step_scale
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.online.fusion.live_time_offset import LiveTimeOffset
from vgps.online.fusion.video_path import VideoPath

SAME_TIME_S = 1e-6  # times of frames, fixes and nodes closer than this are one up to rounding
_HALF_S = 0.1  # a velocity is a difference of positions at least so long before and after


@dataclass(frozen=True)
class SeenFixes:
    """Fixes (M,) and the camera when they were taken.

    Attributes:
        fixes: At the times of their time stamps, the time offset known before the map removed.
        rest_s: Rest of the time offset, as known so far.
        time_offset_s: (M,) the same, less where the path begins later.
        camera: (M, 4, 4) poses in the map at that time before the time stamps.
        velocity: (M, 3) the camera's mean within reach of the time offset, in the map, per second.
        bend: (M,) how far the path departs from that there, in the map.
    """

    fixes: Fixes
    rest_s: float
    time_offset_s: FloatArray
    camera: FloatArray
    velocity: FloatArray
    bend: FloatArray


def seen_fixes(path: VideoPath, fixes: Fixes, rest: LiveTimeOffset) -> SeenFixes:
    """Return those of the fixes with time stamps within a path that were taken before its end.

    Args:
        path: The path.
        fixes: The fixes.
        rest: What is believed of the rest of the time offset.
    """
    rest_s, half_s = rest.time_offset_s, max(rest.reach_s, _HALF_S)
    since_s, until_s = path.t_s[[0, -1]]
    inside = (fixes.t_s >= since_s - SAME_TIME_S) & (fixes.t_s <= until_s + min(rest_s, 0.0))
    fixes = fixes.where(inside)
    t_s = np.maximum(fixes.t_s - rest_s, since_s)
    ends_s, camera = np.clip([t_s - half_s, t_s + half_s], since_s, until_s), path.at(t_s)
    ends = np.stack([path.at(end_s)[:, :3, 3] for end_s in ends_s])
    velocity = (ends[1] - ends[0]) / np.diff(ends_s, axis=0)[0][:, None]
    departure = ends - camera[:, :3, 3] - (ends_s - t_s)[:, :, None] * velocity
    bend = np.linalg.norm(departure, axis=2).max(axis=0, initial=0.0)
    return SeenFixes(fixes, rest_s, fixes.t_s - t_s, camera, velocity, bend)


@dataclass(frozen=True, kw_only=True)
class NodeFixes:
    """Fixes (M,) that take part.

    Attributes:
        node: (M,) node of each.
        fix_class: (M,) class of each.
        down_classed: (M,) whether this is the class below the receiver's.
        step: (M, 3) camera at the fix minus camera at the node, in the map.
        velocity: (M, 3) the camera's about the fix, in the map, per second.
        bend: (M,) how far the path departs from that within reach of the time offset, in the map.
        time_offset_s: (M,) rest of the time offset for which the step holds.
        axes: (M, 3, 3) rotation from the camera's axes at the fix to the map's.
        world_p_fix: (M, 3) the fixes.
        noise_m: (M, 3) scales of Student's t, with ``tail`` (M,) degrees of freedom.
    """

    node: IntArray
    fix_class: IntArray
    down_classed: BoolArray
    step: FloatArray
    velocity: FloatArray
    bend: FloatArray
    time_offset_s: FloatArray
    axes: FloatArray
    world_p_fix: FloatArray
    noise_m: FloatArray
    tail: FloatArray

    def with_bends(self, scale: FloatArray) -> "NodeFixes":
        """Return fixes whose noise holds the bends, metres by scales (M,), as they tell no time offset."""
        bend_m = (scale * self.bend)[:, None]
        return replace(self, noise_m=np.hypot(self.noise_m, bend_m))


def node_fixes(seen: SeenFixes, camera: FloatArray, node: IntArray, config: Config) -> NodeFixes:
    """Return what ties fixes (M,) to their nodes (M,).

    An offset stands for the fixes of an interval and holds at the first of them. Its walk until the others
    is part of their noise, else it would look like the speed of the path.

    Args:
        seen: The fixes, in order of time.
        camera: (N, 4, 4) poses of all nodes in the map.
        node: (M,) node of each fix.
        config: Noise of the fix classes.
    """
    errors = mean_errors(seen.fixes, config.gps)
    since_s = seen.fixes.t_s - seen.fixes.t_s[np.searchsorted(node, node)]
    noise_m = np.hypot(errors.noise_m, step_scale(errors, since_s))[:, None]
    return NodeFixes(
        node=node,
        fix_class=seen.fixes.fix_class,
        down_classed=seen.fixes.down_classed,
        step=seen.camera[:, :3, 3] - camera[node, :3, 3],
        velocity=seen.velocity,
        bend=seen.bend,
        time_offset_s=seen.time_offset_s,
        axes=seen.camera[:, :3, :3],
        world_p_fix=seen.fixes.world_p_fix,
        noise_m=np.hypot(
            np.hstack([noise_m, noise_m, errors.vertical[:, None] * noise_m]), seen.fixes.logging_sigma_m
        ),
        tail=errors.tail,
    )
