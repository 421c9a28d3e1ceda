r"""Penalties on the offset between an estimated antenna and a GPS fix, Sec. 3.3.2 and 4.3, Kume 2010.

Every penalty acts on ``offset = (x, y, z) = antenna_world - fix_world``, metres east, north, up, Eq. (17),
and gives a residual e(offset) in R^3 with a noise model, so that GTSAM's cost ``0.5 ||e / sigma||^2`` is the
penalty's term ``omega Psi`` of the energy Eq. (11).

**Walls as vectors.** Eq. (16) needs only the squares of ``(rho/r)^n`` and ``(|z|/h)^n``. Instead of these two
lengths the residual holds the vectors ``|u|^(n-1) u`` with ``u = (x, y)/r`` and ``u = z/h``: the same energy,
but smooth at rho = 0 and z = 0 for n = 1 too, and with some of the curvature along the wall.

**Far outside, a straight line.** Gauss-Newton on ``a^n`` takes ``a`` to ``a (1 - 1/n)``: an iteration divides
the whitened residual ``w = sqrt(2 omega) a^n`` by e only, so a bad start costs ``n ln(a)`` iterations, and on
the way w^2 drowns the rest of the normal equations or overflows. So beyond the ``a_max`` where w reaches
``WALL_LIMIT`` the residual follows its tangent, ``a_max^n (1 + n (a / a_max - 1))``. From any distance one
step lands at ``a_max (1 - 1/n)``, and about ``ln(WALL_LIMIT) = 7`` more reach the wall, whatever n. The cost
stays convex in the offset and C1, so an optimum whose residuals are all below the limit (a cost of 5e5 for
one fix) does not move at all.

**From inside, a wall with large n is not seen** by Gauss-Newton until it is hit: where the rest of the graph
pulls through it, steps are rejected until they are short. Solving with the exponents of :func:`stages` in
turn, each from the last optimum, brings the wall in gradually.
"""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, sqrt
from typing import Protocol

import gtsam
import numpy as np

from factors.custom import FloatArray

WALL_LIMIT = 1e3
"""Whitened residual beyond which a wall goes on as a straight line."""


class Penalty(Protocol):
    """What a GPS factor asks of a penalty."""

    def residual(self, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual (3,) and its Jacobian (3, 3) at an offset (3,), metres east, north, up."""
        ...

    def noise_model(self) -> gtsam.noiseModel.Base:
        """The residual's noise model, of dimension 3."""
        ...

    def cost(self, offsets: FloatArray) -> FloatArray:
        """Cost (N,) at offsets (N, 3): what a factor with this penalty adds to the graph's error."""
        ...


@dataclass(frozen=True)
class Cylinder:
    """A cylinder around the fix, silent inside, Eq. (16): ``omega ((rho/r)^(2n) + (|z|/h)^(2n))``.

    Residual: ``[(rho/r)^(n-1) (x, y)/r, (|z|/h)^(n-1) z/h]``, sigma ``1/sqrt(2 omega)``.

    Attributes:
        r_m, h_m: Radius r(p) and half height h(p).
        n: Exponent, a natural number; the larger, the steeper the wall.
        omega: Weight of Eq. (11). The thesis has 1e-8.

    Raises:
        ValueError: A number is not positive.
    """

    r_m: float
    h_m: float
    n: int
    omega: float

    def __post_init__(self) -> None:
        _require_positive(r_m=self.r_m, h_m=self.h_m, n=self.n, omega=self.omega)

    def residual(self, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :class:`Penalty`."""
        horizontal, horizontal_by_offset = _wall(self._scales[0], offset, self.n, _limit(self.omega))
        vertical, vertical_by_offset = _wall(self._scales[1], offset, self.n, _limit(self.omega))
        return horizontal + vertical, horizontal_by_offset + vertical_by_offset

    def noise_model(self) -> gtsam.noiseModel.Base:
        """See :class:`Penalty`."""
        return gtsam.noiseModel.Isotropic.Sigma(3, 1 / sqrt(2 * self.omega))

    def cost(self, offsets: FloatArray) -> FloatArray:
        """See :class:`Penalty`."""
        return _wall_cost(self._scales, offsets, self.n, self.omega)

    @cached_property
    def _scales(self) -> FloatArray:
        return np.array([[1 / self.r_m, 1 / self.r_m, 0], [0, 0, 1 / self.h_m]])


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid around the fix, Eq. (22): ``omega ((x^2 + y^2)/alpha^2 + z^2/beta^2)^n``.

    Eq. (22) as printed scales y by beta; the vertical axis is meant. Residual: ``|u|^(n-1) u`` with
    ``u = (x/alpha, y/alpha, z/beta)``, sigma ``1/sqrt(2 omega)``.

    Attributes:
        alpha_m, beta_m: Horizontal and vertical semi-axis.
        n: Exponent, a natural number; the larger, the steeper the wall.
        omega: Weight of Eq. (11).

    Raises:
        ValueError: A number is not positive.
    """

    alpha_m: float
    beta_m: float
    n: int
    omega: float

    def __post_init__(self) -> None:
        _require_positive(alpha_m=self.alpha_m, beta_m=self.beta_m, n=self.n, omega=self.omega)

    def residual(self, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :class:`Penalty`."""
        return _wall(self._scales[0], offset, self.n, _limit(self.omega))

    def noise_model(self) -> gtsam.noiseModel.Base:
        """See :class:`Penalty`."""
        return gtsam.noiseModel.Isotropic.Sigma(3, 1 / sqrt(2 * self.omega))

    def cost(self, offsets: FloatArray) -> FloatArray:
        """See :class:`Penalty`."""
        return _wall_cost(self._scales, offsets, self.n, self.omega)

    @cached_property
    def _scales(self) -> FloatArray:
        return np.array([[1 / self.alpha_m, 1 / self.alpha_m, 1 / self.beta_m]])


@dataclass(frozen=True)
class Gaussian:
    """A pull to the fix, Eq. (14) and (15): ``0.5 ||offset / sigma||^2``; the residual is the offset.

    Attributes:
        sigma_m: Standard deviations east, north, up. The same numbers for every fix make Eq. (14), with
            ``omega = 1 / (2 sigma^2)``; the receiver's own tau make Eq. (15), with omega = 1/2, or
            ``tau / sqrt(2 omega)`` for another omega.
        cauchy_k: Makes the pull robust: a Cauchy loss on the length of offset / sigma that bends at k
            (2.385 keeps 95 % efficiency on one-dimensional Gaussian errors). None is the plain Gaussian.

    Raises:
        ValueError: A number is not positive.
    """

    sigma_m: tuple[float, float, float]
    cauchy_k: float | None = None

    def __post_init__(self) -> None:
        east, north, up = self.sigma_m
        _require_positive(sigma_east=east, sigma_north=north, sigma_up=up)
        if self.cauchy_k is not None:
            _require_positive(cauchy_k=self.cauchy_k)

    def residual(self, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :class:`Penalty`."""
        return offset, np.eye(3)

    def noise_model(self) -> gtsam.noiseModel.Base:
        """See :class:`Penalty`."""
        plain = gtsam.noiseModel.Diagonal.Sigmas(np.array(self.sigma_m))
        if self.cauchy_k is None:
            return plain
        return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(self.cauchy_k), plain)

    def cost(self, offsets: FloatArray) -> FloatArray:
        """See :class:`Penalty`."""
        square: FloatArray = np.sum((offsets / np.array(self.sigma_m)) ** 2, axis=1)
        if self.cauchy_k is None:
            return 0.5 * square
        return 0.5 * self.cauchy_k**2 * np.log1p(square / self.cauchy_k**2)


def stages(n: int) -> list[int]:
    """Exponents to solve with in turn: 1, 2, 4, ... and n.

    Raises:
        ValueError: n is not positive.
    """
    _require_positive(n=n)
    return [2**k for k in range(n.bit_length()) if 2**k < n] + [n]


def _limit(omega: float) -> float:
    """The unwhitened residual at which a wall becomes straight."""
    return WALL_LIMIT / sqrt(2 * omega)


def _wall(scale: FloatArray, offset: FloatArray, n: int, limit: float) -> tuple[FloatArray, FloatArray]:
    """``g(a) u/a`` with ``u = scale * offset``, ``a = |u|``: residual (3,) and Jacobian (3, 3) to the offset.

    ``g(a) = a^n``, and its tangent where that exceeds ``limit``.
    """
    u = scale * offset
    a = sqrt(u @ u)
    inside = min(a, limit ** (1 / n))
    slope = n * inside ** (n - 1)
    # g(a)/a, exact at a = 0
    ratio = inside ** (n - 1) if a == inside else (limit + slope * (a - inside)) / a
    direction = u / a if a > 0 else u
    jacobian = ratio * np.eye(3) + (slope - ratio) * direction[:, None] * direction
    return ratio * u, jacobian * scale


def _wall_cost(scales: FloatArray, offsets: FloatArray, n: int, omega: float) -> FloatArray:
    """``omega`` times the sum of ``g(a)^2`` over the walls ``scales`` (W, 3), at offsets (N, 3)."""
    limit = _limit(omega)
    a = np.linalg.norm(offsets[:, None, :] * scales, axis=2)
    inside = np.minimum(a, limit ** (1 / n))
    g = inside**n + n * inside ** (n - 1) * (a - inside)
    cost: FloatArray = omega * np.sum(g**2, axis=1)
    return cost


def _require_positive(**numbers: float) -> None:
    for name, number in numbers.items():
        if not (isfinite(number) and number > 0):
            raise ValueError(f"{name} is {number}, expected a positive number")
