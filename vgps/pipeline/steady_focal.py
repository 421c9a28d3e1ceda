"""Runs with pictures scaled to one focal length, where a run before shows that it changes."""

from dataclasses import replace

import numpy as np

from vgps.landmarks.observation_selection import collect_observations
from vgps.model import FocalChanges, Recording
from vgps.readers.views.steady import steady
from vgps.solution import Solution


def with_steady_focal(recording: Recording, solution: Solution) -> Recording:
    """Return the recording with pictures of one focal length; the same if its run shows no changes."""
    changes = solution.sensors.focal_changes
    return recording if changes is None else steady(recording, changes)


def refuses_more(solution: Solution, before: Solution) -> bool:
    """Whether a run refuses more fixes than one before, so that its path is further astray."""
    used = [0 if one.fixes is None else int(one.fixes.used.sum()) for one in (solution, before)]
    return used[0] < used[1]


def fits_worse(solution: Solution, before: Solution) -> bool:
    """Whether the observations of a run fit its landmarks less well than those of the one before.

    Frames whose times are wrong contradict the fixes, and a zoom may seem to explain that, but not what the
    pictures show. Half-way to the changes of a true zoom pictures fit less well, too; in the end they do not.
    """
    return _misfit_px(solution) > _misfit_px(before)


def _misfit_px(solution: Solution) -> float:
    """Return the mean distance of observations from where their landmarks are seen."""
    seen = collect_observations(solution)
    return float(seen.error_px[seen.depth_m > 0.0].mean())


def with_focal_note(solution: Solution) -> Solution:
    """Return the solution with a warning about changes of the focal length, if there are any."""
    used, left = solution.camera.focal_changes, solution.sensors.focal_changes
    notes = []
    if used is not None:
        notes.append(
            f"the focal length changes by {_percent(used):.2g} % in the video, as by focus or zoom: the "
            "run is of pictures scaled to one; solution.json has the changes, and exports allow for them"
        )
    if left is not None and used is not None:
        notes.append(f"they still show changes of the focal length by {_percent(left):.2g} %")
    elif left is not None:
        notes.append(
            f"changes of the focal length by {_percent(left):.2g} % would explain video and fixes better, "
            "but runs without them were no better: frames or fixes whose times are wrong look the same"
        )
    return replace(solution, warnings=(*solution.warnings, "; ".join(notes))) if notes else solution


def _percent(changes: FocalChanges) -> float:
    """Return the range of the focal length as a share of it, in percent."""
    return 100.0 * float(np.expm1(np.ptp(changes.log_ratio)))
