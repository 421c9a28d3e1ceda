"""A GPS clock that is wrong by seconds, found by the shape of the path.

Displacements between neighbouring fixes are compared with those of the camera over the same time at every
time offset, each at the best slowly changing scale and heading. A clock that is wrong by more than a turn
lasts has no gradient to follow, so all offsets are tried; one counts if no other explains the fixes nearly
as well.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import SensorsConfig, StartConfig
from vgps.gps.clock_misfit import MIN_PAIRS, Misfit, Seen, misfit_at, seen_antenna
from vgps.gps.fixes import Fixes
from vgps.gps.time_offset import compared_fixes
from vgps.model import FloatArray
from vgps.solution import GpsClock, Trajectory

REACH_S = 60.0  # to either side; GPS time, taken for UTC, is 18 s ahead
_STEP_S = 0.2  # a fraction of the time that a turn takes
_FINE_STEP_S = 0.02  # around the offset found: a run that begins nearer to the right one ends nearer to it
_MIN_SHARE = 0.5  # of the pairs that the best overlap has
_FAR_LESS = 0.5  # times what a path leaves of the motion, by its mirror image


class ClockCheck(NamedTuple):
    """What was found when the GPS clock was compared with a path of the video alone.

    Attributes:
        shown_s: Time offset that its shape shows; None if it shows none.
        torn: Whether most fixes are outside their regions all the same: the path has been torn to them.
        other: The clock that displacements show if it has another rate; None if they show none.
        video: That path; None if there was none to compare.
        turned_deg: By how much the camera is turned clockwise against what was assumed, by whole quarters.
        mirrored: Whether the mirror image of that path explains the fixes, and the path does not.
    """

    shown_s: float | None
    torn: bool = False
    other: GpsClock | None = None
    video: Trajectory | None = None
    turned_deg: float = 0.0
    mirrored: bool = False


def search_time_offset(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> float | None:
    """Return the time offset that the motion shows beyond doubt; None if it shows none.

    The fixes may be far off the path: neither its place, nor its scale, nor its heading counts. Wrong ones
    make the offset less sure, so that a log with many of them shows none.

    Args:
        path: Of the video alone, level; every scale and heading will do.
        fixes: Fixes at the times of their time stamps, wrong ones among them; used ones count.
        camera_p_antenna: (3,) metres.
        config: How far around an offset others are taken for the same, and how sure it must be.
    """
    offsets_s, found, cost = _searched(path, fixes, camera_p_antenna, config)
    best = int(np.argmin(cost))
    reach_s = config.time_offset_reach_s
    others = np.flatnonzero(np.isfinite(cost) & (np.abs(offsets_s - offsets_s[best]) > reach_s))
    tried = 1.0 + len(others) * _STEP_S / reach_s
    clear = (found[best].clearly_less(found[k], config.significance_sigmas, tried) for k in others.tolist())
    if not len(others) or not all(clear):
        return None
    near_s = offsets_s[best] + np.arange(-_STEP_S, _STEP_S + _FINE_STEP_S / 2, _FINE_STEP_S)
    costs = [one.cost for one in _misfits(near_s, path, fixes, camera_p_antenna, config)]
    return round(float(near_s[int(np.argmin(costs))]), 2)


def unexplained_share(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> float:
    """Return the share of the fixes' motion that the path leaves at the time offset that suits them best.

    Args:
        path, fixes, camera_p_antenna, config: As for :func:`search_time_offset`.
    """
    _, found, cost = _searched(path, fixes, camera_p_antenna, config)
    return found[int(np.argmin(cost))].share


def _searched(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> tuple[FloatArray, list[Misfit], FloatArray]:
    """Return the time offsets (n,), what is left at each, and its cost, infinite without enough pairs."""
    offsets_s = config.time_offset_s + np.arange(-REACH_S, REACH_S + _STEP_S / 2, _STEP_S)
    found = _misfits(offsets_s, path, fixes, camera_p_antenna, config)
    pairs = np.array([len(one.left) for one in found])
    overlapping = pairs >= max(MIN_PAIRS, _MIN_SHARE * pairs.max())
    return offsets_s, found, np.where(overlapping, [one.cost for one in found], np.inf)


def _misfits(
    offsets_s: FloatArray,
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: SensorsConfig,
) -> list[Misfit]:
    """Return what is left at each of some time offsets."""
    seen, chosen = seen_antenna(path, camera_p_antenna), compared_fixes(fixes)
    return [misfit_at(seen, chosen, offset_s, config.time_offset) for offset_s in offsets_s.tolist()]


def shows_no_time_offset(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> bool:
    """Return whether the motion explains the fixes as well at other time offsets near the configured one.

    So it does on a straight or in a circle at constant speed, where another one is another place or heading.

    Args:
        path, fixes, camera_p_antenna, config: As for :func:`search_time_offset`.
    """
    offsets_s = np.array([config.time_offset_s, *_near(config)])
    held, *others = _misfits(offsets_s, path, fixes, camera_p_antenna, config)
    tried = float(len(others))
    return not any(held.clearly_less(other, config.significance_sigmas, tried) for other in others)


def mirrored_share(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> float | None:
    """Return the share of the fixes' motion that the mirror image of a path leaves, if it explains them far
    better than the path itself, beyond doubt.

    Turns to the left are turns to the right then, as in a mirrored picture or of a camera upside down.

    Args:
        path: Of the video alone, level.
        fixes, camera_p_antenna, config: As for :func:`search_time_offset`.
    """
    seen, chosen = seen_antenna(path, camera_p_antenna), compared_fixes(fixes)
    offsets_s = _near(config)

    def least(one: Seen) -> Misfit:
        found = (misfit_at(one, chosen, offset_s, config.time_offset) for offset_s in offsets_s.tolist())
        return min(found, key=lambda misfit: misfit.cost)

    right, mirrored = least(seen), least(seen._replace(antenna=seen.antenna.conj()))
    beyond_doubt = mirrored.clearly_less(right, config.significance_sigmas, float(len(offsets_s)))
    return mirrored.share if beyond_doubt and mirrored.share < _FAR_LESS * right.share else None


def _near(config: SensorsConfig) -> FloatArray:
    """Return the time offsets that the search by displacements reaches."""
    reach_s = config.time_offset_reach_s
    return np.asarray(config.time_offset_s + np.arange(-reach_s, reach_s + _STEP_S / 2, _STEP_S))


def levelled(path: Trajectory, start: StartConfig) -> Trajectory:
    """Return a path in any frame, turned so that the plane of its motion is level.

    A camera looks ahead or down, and is turned as the settings say, which tells above from below.
    """
    poses = path.world_T_camera
    centres = poses[:, :3, 3] - poses[:, :3, 3].mean(axis=0)
    up = np.linalg.eigh(centres.T @ centres)[1][:, 0]
    down_and_forward = start.upright[:, 1] + start.upright[:, 2]
    up *= -np.sign(up @ (poses[:, :3, :3] @ down_and_forward).mean(axis=0)) or 1.0
    level_T_world = np.eye(4)
    level_T_world[:3, :3] = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])[0].as_matrix()
    return Trajectory(path.t_s, level_T_world @ poses)
