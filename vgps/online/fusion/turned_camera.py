"""A camera that is turned about its axis of view, against what was assumed when its map was placed.

A straight path does not show the roll, so the camera is taken for upright. One that hangs upside down, or a
telephone on its side, then bends the other way than the fixes, or up and down, and no fit turns it over: it
ends at a minimum nearby, with fixes that it doubts. So fits that begin turned by quarters are compared.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vgps.config import Config
from vgps.geometry import rotation_matrices, rotation_vectors
from vgps.gps.camera_roll import OR_MIRRORED
from vgps.gps.fixes import Fixes
from vgps.model import FloatArray
from vgps.online.fusion.fusion_equations import BIAS, MEAN_ROLL, OFFSET, POSITION, FusionState, cost
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.node_fixes import SAME_TIME_S
from vgps.online.fusion.path_fusion import FusedPath, fuse
from vgps.online.fusion.video_path import VideoPath

_UNKNOWN_SHARE = 0.5  # of the prior's sigma, above which the motion does not show the roll
_USUAL_COST, _USUALLY_USED = 1.5, 0.75  # of a fix: half the squares of three residuals; and of all fixes
# Least gains in log-likelihood of turns by quarters. The prior of the mean roll speaks against one of them,
# but not against two, which leave the camera level: one camera in a thousand hangs.
_LEAST_GAIN = np.inf, 8.0, 15.0, 8.0
_HALF = 2  # quarters
# A few fixes whose clock is off, or of which one is wrong, fit a turned camera less badly by chance.
_LEAST_FIXES, _OUTLIER_COST = 6, 5.0  # the latter in log-likelihood, of one in 150


class TurnedPath(NamedTuple):
    """A fit of a path that is turned by quarters about its direction."""

    fused: FusedPath
    quarters: int

    @property
    def note(self) -> str:
        """What the user should know of it."""
        turned, doubt = ("half a turn", OR_MIRRORED) if self.quarters == _HALF else ("a quarter turn", "")
        return (
            f"the fixes show that the camera is turned about its axis of view by {turned} against what was "
            f"assumed, which earlier poses lack: state it with start: {{roll_deg}}{doubt}"
        )


def hides_a_turn(last: FusedPath, path: VideoPath, fixes: Fixes, config: Config) -> bool:
    """Return whether a fit may be that of a turned camera: it does not show the roll, and fits badly or
    leaves many of the fixes out.

    What a fit has forgotten cannot be turned.
    """
    used = len(last.nodes.fixes.node)
    known = used + _left_out(last, fixes)
    roll_deg = np.degrees(np.sqrt(last.covariance[MEAN_ROLL, MEAN_ROLL]))
    return bool(
        known >= _LEAST_FIXES
        and not config.start.flies
        and roll_deg > _UNKNOWN_SHARE * config.start.level_sigma_deg
        and path.t_s[0] <= last.nodes.t_s[0] + SAME_TIME_S
        and (_cost(last) > _USUAL_COST * used or used < _USUALLY_USED * known)
    )


def turned_path(
    path: VideoPath, fixes: Fixes, lever_arm: LeverArm, config: Config, last: FusedPath
) -> TurnedPath | None:
    """Return a fit with the camera turned against the last one, if that explains the fixes well and the last
    one does not.

    Args:
        path, fixes, lever_arm, config: As for :func:`vgps.online.fusion.path_fusion.fuse`.
        last: The last fit of the path.
    """
    upright, *others = (fuse(path, fixes, lever_arm, config, _turned(last, turn)) for turn in range(4))
    best = min(others, key=_cost)
    found = TurnedPath(best, _quarters(upright, best))
    as_before = min(_cost(upright), _cost(last) + _OUTLIER_COST * _left_out(last, fixes))
    against_quarters = float(np.log1p(best.nodes.mean_roll**-2))  # by the prior of the mean roll
    fits = _cost(best) < _USUAL_COST * len(best.nodes.fixes.node) + against_quarters
    return found if fits and as_before - _cost(best) > _LEAST_GAIN[found.quarters] else None


def _left_out(last: FusedPath, fixes: Fixes) -> int:
    """Return how many fixes a fit leaves out as outliers."""
    return int(np.sum(fixes.used & (fixes.t_s <= last.newest_s))) - len(last.nodes.fixes.node)


def _cost(fused: FusedPath) -> float:
    return cost(fused.nodes, fused.state, fused.prior)


def _quarters(one: FusedPath, other: FusedPath) -> int:
    """Return by how many quarters (0 to 3) the camera is turned about the path from one fit to another."""
    turn = rotation_vectors(other.state.world_R_map[-1:] @ one.state.world_R_map[-1:].transpose(0, 2, 1))[0]
    return round(float(turn @ _direction(one.state)) / (0.5 * np.pi)) % 4


def _direction(state: FusionState) -> FloatArray:
    """Return the main direction (3,) of a path."""
    centres = state.values[:, POSITION]
    return np.asarray(np.linalg.svd(centres - centres.mean(axis=0), full_matrices=False)[2][0])


def _turned(last: FusedPath, quarters: int) -> FusedPath:
    """Return a fit turned about its path, its offsets and biases as if unknown."""
    if not quarters:
        return last
    R = rotation_matrices(0.5 * np.pi * quarters * _direction(last.state)[None])[0]
    pivot = last.state.values[:, POSITION].mean(axis=0)
    state, at = (_rotated(one, R, pivot) for one in (last.state, last.prior.at))
    elevation = (state.world_R_map @ last.nodes.axes)[:, 2] - last.nodes.elevation
    state.values[:, OFFSET] = 0.0
    state.values[:, BIAS] = elevation.mean(axis=0)
    return replace(last, state=state, prior=replace(last.prior, at=at), carried=None)


def _rotated(state: FusionState, R: FloatArray, pivot: FloatArray) -> FusionState:
    """Return a state rotated in the world about a point."""
    values = state.values.copy()
    values[:, POSITION] = pivot + (values[:, POSITION] - pivot) @ R.T
    return FusionState(values, R @ state.world_R_map)
