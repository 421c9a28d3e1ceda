r"""Penalties on the offset of the estimated antenna from a GPS fix, Sec. 3.3.2 and 4.3, Kume 2010.

Every penalty takes ``offset = (x, y, z) = antenna_world - fix_world``, metres east, north, up, Eq. (17), and
gives a residual e(offset) in R^3 with a noise model, such that GTSAM's cost ``0.5 ||e / sigma||^2`` is the
term ``omega Psi`` of the energy, Eq. (11).

**Residuals are vectors.** Eq. (16) needs only the squares of ``(rho/r)^n`` and ``(|z|/h)^n``. Instead of
these two lengths the residual contains the vectors ``|u|^(n-1) u`` with ``u = (x, y)/r`` and ``u = z/h``. The
energy is the same, but it is smooth at rho = 0 and z = 0 for n = 1 too, and has curvature along the wall.

**Linear tails.** Gauss-Newton on ``a^n`` takes ``a`` to ``a (1 - 1/n)``: an iteration divides the whitened
residual ``w = sqrt(2 omega) a^n`` only by e, so a bad start takes ``n ln(a)`` iterations, and meanwhile w^2
dominates the normal equations or overflows. Beyond the ``a_max`` where w reaches ``WALL_LIMIT`` the
residual therefore follows its tangent, ``a_max^n (1 + n (a / a_max - 1))``. From any distance one step lands
at ``a_max (1 - 1/n)``, and about ``ln(WALL_LIMIT) = 7`` more reach the wall, whatever n. The cost stays
convex in the offset and C1. An optimum whose residuals are all below the limit (a cost of 5e5 for one fix)
does not move.

**Exponent continuation.** Inside a wall with large n the gradient vanishes, so Gauss-Newton steps straight
through it: where the rest of the graph pulls that far, steps are rejected until they are short. Solving with
the exponents of :func:`exponent_schedule` in turn, each from the previous optimum, raises the wall gradually.
"""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, sqrt
from typing import Protocol

import gtsam
import numpy as np

from factors.custom import FloatArray

WALL_LIMIT = 1e3
"""Whitened residual beyond which a wall continues along its tangent."""


class Penalty(Protocol):
    """Interface of a penalty for the GPS factors."""

    def residual(self, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the residual (3,) and its Jacobian (3, 3) at an offset (3,), metres east, north, up."""
        ...

    def noise_model(self) -> gtsam.noiseModel.Base:
        """Return the noise model of the residual, of dimension 3."""
        ...

    def cost(self, offsets: FloatArray) -> FloatArray:
        """Return the costs (N,) at offsets (N, 3): the error of a factor with this penalty."""
        ...


@dataclass(frozen=True)
class Cylinder:
    """A cylinder around the fix, nearly free inside, Eq. (16): ``omega ((rho/r)^(2n) + (|z|/h)^(2n))``.

    Residual: ``[(rho/r)^(n-1) (x, y)/r, (|z|/h)^(n-1) z/h]``, sigma ``1/sqrt(2 omega)``.

    Attributes:
        r_m, h_m: Radius r(p) and half height h(p).
        n: Exponent, a natural number; the larger, the steeper the wall.
        omega: Weight in Eq. (11); 1e-8 in the thesis.

    Raises:
        ValueError: A parameter is not positive.
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

    As printed, Eq. (22) scales y by beta; the vertical axis is meant. Residual: ``|u|^(n-1) u`` with
    ``u = (x/alpha, y/alpha, z/beta)``, sigma ``1/sqrt(2 omega)``.

    Attributes:
        alpha_m, beta_m: Horizontal and vertical semi-axes.
        n: Exponent, a natural number; the larger, the steeper the wall.
        omega: Weight in Eq. (11).

    Raises:
        ValueError: A parameter is not positive.
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
    """A Gaussian around the fix, Eq. (14) and (15): ``0.5 ||offset / sigma||^2``; the residual is the offset.

    With correlations ``0.5 offset^T covariance^-1 offset``.

    Attributes:
        sigma_m: Standard deviations east, north, up. The same numbers for every fix give Eq. (14) with
            ``omega = 1 / (2 sigma^2)``; the receiver's tau give Eq. (15) with omega = 1/2, and
            ``tau / sqrt(2 omega)`` another omega.
        cauchy_k: Constant of a Cauchy loss on the length of offset / sigma (2.385 keeps 95 % efficiency on
            one-dimensional Gaussian errors); None for no loss.
        correlation: Of east and north, east and up, north and up.

    Raises:
        ValueError: A parameter is not positive, or no covariance has these correlations.
    """

    sigma_m: tuple[float, float, float]
    cauchy_k: float | None = None
    correlation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        east, north, up = self.sigma_m
        _require_positive(sigma_east=east, sigma_north=north, sigma_up=up)
        if self.cauchy_k is not None:
            _require_positive(cauchy_k=self.cauchy_k)
        if not np.all(np.linalg.eigvalsh(self._correlations) > 0):
            raise ValueError(f"correlations of {self.correlation}, expected those of a covariance")

    def residual(self, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """See :class:`Penalty`."""
        return offset, np.eye(3)

    def noise_model(self) -> gtsam.noiseModel.Base:
        """See :class:`Penalty`."""
        sigma = np.array(self.sigma_m)
        plain: gtsam.noiseModel.Gaussian = gtsam.noiseModel.Diagonal.Sigmas(sigma)
        if any(self.correlation):
            # not "smart", which leaves small covariances out
            plain = gtsam.noiseModel.Gaussian.Covariance(sigma[:, None] * self._correlations * sigma, False)
        if self.cauchy_k is None:
            return plain
        return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(self.cauchy_k), plain)

    def cost(self, offsets: FloatArray) -> FloatArray:
        """See :class:`Penalty`."""
        ratio = offsets / np.array(self.sigma_m)
        square = np.asarray(np.sum(ratio * np.linalg.solve(self._correlations, ratio.T).T, axis=1))
        if self.cauchy_k is None:
            return 0.5 * square
        return 0.5 * self.cauchy_k**2 * np.log1p(square / self.cauchy_k**2)

    @cached_property
    def _correlations(self) -> FloatArray:
        en, eu, nu = self.correlation
        return np.array([[1.0, en, eu], [en, 1.0, nu], [eu, nu, 1.0]])


def exponent_schedule(n: int) -> list[int]:
    """Return the exponents to solve with in turn: 1, 2, 4, ... and n.

    Raises:
        ValueError: n is not positive.
    """
    _require_positive(n=n)
    return [2**k for k in range(n.bit_length()) if 2**k < n] + [n]


def _limit(omega: float) -> float:
    """Return the unwhitened residual at which a wall becomes linear."""
    return WALL_LIMIT / sqrt(2 * omega)


def _wall(scale: FloatArray, offset: FloatArray, n: int, limit: float) -> tuple[FloatArray, FloatArray]:
    """Return the residual ``g(a) u/a`` (3,), ``u = scale * offset``, ``a = |u|``, and its Jacobian (3, 3).

    ``g(a)`` is ``a^n``, or its tangent where that exceeds ``limit``.
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
    """Return ``omega`` times the sum of ``g(a)^2`` over the walls ``scales`` (W, 3), at offsets (N, 3)."""
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
