"""GTSAM's incremental fixed-lag smoother with factors that have names, by which they leave again."""

from collections.abc import KeysView, Sequence
from dataclasses import dataclass, field
from typing import Any, SupportsFloat, SupportsIndex, SupportsInt

import gtsam

from vgps.model import FloatArray

Name = tuple[Any, ...]
Stamps = dict[SupportsInt | SupportsIndex, SupportsFloat | SupportsIndex]
"""Times by key, as GTSAM's binding types them."""


@dataclass(frozen=True)
class GraphChange:
    """New factors by name, new variables, times of variables by key, and names of factors to remove."""

    factors: dict[Name, gtsam.NonlinearFactor] = field(default_factory=dict)
    values: gtsam.Values = field(default_factory=gtsam.Values)
    stamps: Stamps = field(default_factory=dict)
    removed: set[Name] = field(default_factory=set)

    @classmethod
    def merged(cls, changes: Sequence["GraphChange"]) -> "GraphChange":
        """Return several changes as one."""
        whole = cls()
        for change in changes:
            whole.factors.update(change.factors)
            whole.values.insert(change.values)
            whole.stamps.update(change.stamps)
            whole.removed.update(change.removed)
        return whole


class FixedLagGraph:
    """iSAM2 over the variables of the last ``lag``; what is older is marginalised into a Gaussian prior.

    A factor can leave as long as all of its variables are there; afterwards it is part of the prior.

    Args:
        lag: A variable leaves once its time is older than the newest one by more than this.
        thresholds: Changes beyond which variables are linearised again, by the first letter of their keys.
    """

    def __init__(self, lag: float, thresholds: dict[str, FloatArray]) -> None:
        parameters, by_letter = gtsam.ISAM2Params(), gtsam.ISAM2ThresholdMap()
        for letter, threshold in thresholds.items():
            by_letter.insert((letter, threshold))
        parameters.setRelinearizeThreshold(by_letter)
        parameters.relinearizeSkip = 1
        parameters.findUnusedFactorSlots = True  # else the list of factors grows with the video
        self._smoother = gtsam.IncrementalFixedLagSmoother(lag, parameters)
        self._lag = lag
        self._stamps: dict[int, float] = {}
        self._slots: dict[Name, tuple[int, tuple[int, ...]]] = {}

    def __contains__(self, key: int) -> bool:
        """Whether a variable is in the smoother."""
        return key in self._stamps

    def names(self) -> KeysView[Name]:
        """Return the names of the factors that can leave."""
        return self._slots.keys()

    def update(self, change: GraphChange, iterations: int) -> gtsam.Values:
        """Apply a change, and return the estimate of all variables in the lag.

        Args:
            change: Every variable of a new factor is there or new, and every new variable has a time.
            iterations: Gauss-Newton steps at most.

        Raises:
            RuntimeError: GTSAM finds the system indeterminate; the smoother cannot be used any more.
        """
        removed = [self._slots.pop(name)[0] for name in change.removed]
        graph = gtsam.NonlinearFactorGraph()
        for factor in change.factors.values():
            graph.push_back(factor)
        self._smoother.update(graph, change.values, change.stamps, removed)
        slots = self._smoother.getISAM2Result().getNewFactorsIndices()
        for (name, factor), slot in zip(change.factors.items(), slots, strict=True):
            self._slots[name] = (int(slot), tuple(factor.keys()))
        for _ in range(iterations - 1):
            self._smoother.update()
            if not self._smoother.getISAM2Result().getVariablesRelinearized():
                break
        self._forget(change.stamps)
        return self._smoother.calculateEstimate()

    def _forget(self, stamps: Stamps) -> None:
        """Forget the variables that have left, and the factors that became part of the prior with them."""
        self._stamps |= {int(key): float(stamp) for key, stamp in stamps.items()}
        oldest = max(self._stamps.values()) - self._lag
        self._stamps = {key: stamp for key, stamp in self._stamps.items() if stamp >= oldest}
        here = self._stamps.keys()
        self._slots = {
            name: slot for name, slot in self._slots.items() if all(key in here for key in slot[1])
        }
