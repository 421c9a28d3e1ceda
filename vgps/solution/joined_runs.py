"""Several runs in one world."""

from collections.abc import Mapping
from dataclasses import dataclass

from vgps.model import IntArray
from vgps.solution.landmarks import Landmarks, Observations
from vgps.solution.result import Solution


@dataclass(frozen=True, kw_only=True)
class JoinedRuns:
    """The result of a join: several runs in one world.

    Attributes:
        names: Names of the runs.
        solutions: Each run in the world of the first.
        landmarks, observations: All landmarks; frames are counted through all runs.
        ties: (R, R) number of frames of a run (row) that see a place of an earlier one (column).
        warnings: Warnings for the user.
        seconds: Wall seconds by stage.
    """

    names: tuple[str, ...]
    solutions: tuple[Solution, ...]
    landmarks: Landmarks
    observations: Observations
    ties: IntArray
    warnings: tuple[str, ...]
    seconds: Mapping[str, float]
