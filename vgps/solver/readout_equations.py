"""Normal equations of an estimated readout: a coordinate of the border that all observations share."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from vgps.model import FloatArray
from vgps.solver.pose_equations import Border
from vgps.solver.problem import BundleProblem
from vgps.solver.row_equations import RollingChunk
from vgps.solver.row_times import READOUT
from vgps.solver.unknowns import Unknowns

Term = tuple[RollingChunk, FloatArray]
"""A chunk, and residuals (2, n) by which a readout longer by a second changes something."""


def readout_column(problem: BundleProblem) -> int | None:
    """Return the readout's column among the shared coordinates; None if it is not estimated."""
    if problem.row_times is None or READOUT not in problem.shared:
        return None
    return sum(len(vector) for key, vector in problem.shared.items() if key < READOUT)


def add_to_border(
    border: Border, column: int, terms: Iterable[Term], unknowns: Unknowns, sign: float = 1.0
) -> Border:
    """Return the border with the products of the terms and the observations' Jacobians added, times a sign.

    Args:
        border: Normal equations of the shared vectors.
        column: Column of the readout.
        terms: The observations.
        unknowns: Places of the poses.
        sign: Plus or minus one.
    """
    hessian, gradient = border.hessian.copy(), border.gradient.copy()
    coupling, by_pose = border.coupling.copy(), np.zeros((6, len(unknowns.free)))
    for part, change in terms:
        first = part.chunk.first_frame
        by_pose[:, first : first + part.chunk.frames] += part.pose_gradient(change)
        hessian[column, column] += sign * float(np.sum(part.by_readout * change))
        gradient[column] += sign * float(np.sum(part.r * change))
    coupling[:, column] += sign * unknowns.to_columns(by_pose.T)
    return replace(border, coupling=coupling, hessian=hessian, gradient=gradient)
