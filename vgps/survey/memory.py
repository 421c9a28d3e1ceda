"""How the error of a fix changes from one fix to the next: noise about an offset that walks with heavy tails.

A fix is antenna + offset + noise. Within a stretch (one fix class, no long gap) the offset is a Levy process
whose change over one second is Student-t; its change over other times is what sums of such changes are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import fht
from scipy.optimize import Bounds, minimize
from scipy.special import gammaln, kve

from vgps.model import FixClass, FloatArray, IntArray

_LAGS_S = (0.2, 1.0, 2.0, 5.0, 10.0)  # noise shows in the shortest, the walk in how changes grow
_TAILS = (0.5, 30.0)  # heavier than any receiver's; lighter is Gaussian
_RESOLUTION_M = 1e-4  # of positions in logs; shorter changes say that nothing changed

# radii and their Fourier dual, in units of the model's own scale: a hundred thousandth to a hundred thousand
_FREQUENCY = np.geomspace(1e-5, 1e5, 512)
_LOG_RADIUS = -np.log(_FREQUENCY[::-1])
_SPACING = float(np.log(_FREQUENCY[1] / _FREQUENCY[0]))
_RELIABLE = 1e-8  # of the largest value of a transform; less is rounding

_PRIOR_SHARE, _PRIOR_TAIL, _PRIOR_VERTICAL = 0.3, 3.0, 2.0
_PRIOR_LOG_SIGMAS = np.array([1.5, 1.5, 1.0, 0.7])
_STARTS = ((0.3, 0.3), (0.05, 0.5), (0.5, 0.05))  # noise and walk as shares of the median change


@dataclass(frozen=True, kw_only=True)
class Memory:
    """Noise and walk of the errors of one fix class.

    Attributes:
        noise_m: Sigma of the noise about the offset, on each horizontal axis.
        walk_m: Scale of the offset's Student-t change over one second, on each horizontal axis.
        tail: Degrees of freedom of that change; 1 is a Cauchy distribution, 30 nearly Gaussian.
        vertical: Both on the vertical axis, over those on a horizontal one.
    """

    noise_m: float
    walk_m: float
    tail: float
    vertical: float

    def log_density(self, lag_s: float, change_m: FloatArray) -> FloatArray:
        r"""Return the logarithm of the density (N,) of changes of the error over a time, per m^3.

        With the vertical axis divided by ``vertical`` it is isotropic, with the characteristic function

            \phi(s) = t_{tail}(walk s)^{lag} exp(-noise^2 s^2),

        t being that of the multivariate Student-t, which is infinitely divisible (Grosswald 1976), and noise
        counting at both ends. Its inverse is a Hankel transform of order 1/2.

        Args:
            lag_s: The time.
            change_m: (N, 3) east, north, up.
        """
        return self._log_densities([lag_s], [change_m])[0]

    def _log_densities(self, lags_s: Sequence[float], changes_m: Sequence[FloatArray]) -> list[FloatArray]:
        """Return log densities at several lags, for which the Bessel functions are evaluated once."""
        unit = float(np.hypot(self.noise_m, self.walk_m))
        walk = _log_characteristic(self.tail, self.walk_m / unit * _FREQUENCY)
        exponent = np.multiply.outer(lags_s, walk) - (self.noise_m / unit * _FREQUENCY) ** 2
        transforms = fht(np.exp(exponent) * _FREQUENCY**1.5, _SPACING, 0.5)
        found, axes = [], np.array([1.0, 1.0, self.vertical])
        for transform, change in zip(transforms, changes_m, strict=True):
            log_radius = np.log(np.maximum(np.linalg.norm(change / axes, axis=1) / unit, 1e-9))
            radial = _log_radial_density(transform, self.tail, log_radius)
            found.append(radial - 3.0 * np.log(unit) - np.log(self.vertical))
        return found


@dataclass(frozen=True)
class Changes:
    """Changes of the error over one time: (N, 3) east, north, up.

    Pairs of epochs overlap; ``weight`` makes them count as those that do not.
    """

    lag_s: float
    change_m: FloatArray
    weight: float


def find_stretches(t_s: FloatArray, fix_class: Sequence[FixClass], max_gap_s: float) -> IntArray:
    """Return (N,) the number of each epoch's stretch: one fix class, no gap, time not going back."""
    names = np.array([str(name) for name in fix_class])
    step_s = np.diff(t_s)
    ends = (names[1:] != names[:-1]) | (step_s > max_gap_s) | (step_s <= 0.0)
    return np.concatenate([[0], np.cumsum(ends)]) if len(t_s) else np.zeros(0, np.int64)


def find_changes(t_s: FloatArray, error_m: FloatArray, stretch: IntArray) -> list[Changes]:
    """Return the changes of the error within stretches over about 0.2, 1, 2, 5 and 10 s, shortest first.

    Args:
        t_s: (N,) epochs of one class.
        error_m: (N, 3) east, north, up.
        stretch: (N,) from `find_stretches`.
    """
    within = np.diff(t_s)[np.diff(stretch) == 0]
    if not len(within):
        return []
    step_s = float(np.median(within))
    found = []
    for count in sorted({max(round(lag_s / step_s), 1) for lag_s in _LAGS_S}):
        lag_s = count * step_s
        paired = stretch[count:] == stretch[:-count]
        paired &= np.abs(t_s[count:] - t_s[:-count] - lag_s) < 0.5 * step_s
        change_m = (error_m[count:] - error_m[:-count])[paired]
        if len(change_m):
            found.append(Changes(lag_s, change_m, 1.0 / count))
    return found


def fit_memory(changes: Sequence[Changes]) -> Memory:
    """Fit noise and walk to changes by maximum composite likelihood over the lags.

    A weak log-normal prior about the size of the shortest changes decides where they are too few.

    Args:
        changes: From `find_changes`, shortest lag first; at least one.
    """
    typical = _typical(changes[0].change_m)
    share = _PRIOR_SHARE * typical
    centre = np.log([share, share, _PRIOR_TAIL, _PRIOR_VERTICAL])
    lags_s, errors_m = [one.lag_s for one in changes], [one.change_m for one in changes]

    def cost(logs: FloatArray) -> float:
        densities = _memory(logs)._log_densities(lags_s, errors_m)
        fit = sum(one.weight * float(density.sum()) for one, density in zip(changes, densities, strict=True))
        return 0.5 * float(np.sum(((logs - centre) / _PRIOR_LOG_SIGMAS) ** 2)) - fit

    sizes = (0.01 * typical, 30.0 * typical)
    bounds = Bounds(*np.log([sizes, sizes, _TAILS, (0.1, 20.0)]).T)
    starts = [np.log([a * typical, b * typical, 2.0, _PRIOR_VERTICAL]) for a, b in _STARTS]
    fits = [minimize(cost, start, method="L-BFGS-B", bounds=bounds) for start in starts]
    return _memory(min(fits, key=lambda fit: float(fit.fun)).x)


def _memory(logs: FloatArray) -> Memory:
    noise_m, walk_m, tail, vertical = (float(x) for x in np.exp(logs))
    return Memory(noise_m=noise_m, walk_m=walk_m, tail=tail, vertical=vertical)


def _typical(change_m: FloatArray) -> float:
    """Return the median length of changes, without those of a receiver that repeats its position."""
    length = np.linalg.norm(change_m, axis=1)
    changed = length[length > _RESOLUTION_M]
    return float(np.median(changed)) if len(changed) else _RESOLUTION_M


def _log_characteristic(tail: float, scaled: FloatArray) -> FloatArray:
    """Return the logarithm of the multivariate Student-t's characteristic function at scale times frequency.

    Hurst (1995): K_{tail/2}(z) z^{tail/2} / (Gamma(tail/2) 2^{tail/2 - 1}) with z = sqrt(tail) scale s.
    """
    z, half = np.sqrt(tail) * scaled, 0.5 * tail
    with np.errstate(over="ignore", invalid="ignore"):
        found = np.log(kve(half, z)) - z + half * np.log(z) - gammaln(half) - (half - 1.0) * np.log(2.0)
    finite: FloatArray = np.where(np.isfinite(found), np.minimum(found, 0.0), 0.0)
    return finite


def _log_radial_density(transform: FloatArray, tail: float, log_radius: FloatArray) -> FloatArray:
    """Return the log density at radii; beyond what the transform resolves it falls as a Student-t's tail."""
    good = transform > _RELIABLE * transform.max()
    top = int(transform.argmax())
    first = top - int(np.argmin(np.append(good[top::-1], False))) + 1
    last = top + int(np.argmin(np.append(good[top:], False))) - 1
    grid = _LOG_RADIUS[first : last + 1]
    density = np.log(transform[first : last + 1]) - 1.5 * (grid + np.log(2.0 * np.pi))
    beyond = np.maximum(log_radius - grid[-1], 0.0)
    found: FloatArray = np.interp(log_radius, grid, density) - (tail + 3.0) * beyond
    return found
