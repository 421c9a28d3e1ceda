"""How do the errors of receivers change over time, and does what others show hold for the next one?

Per fix class: constants of the error model with memory of every receiver, pooled over receivers (geometric
mean, spread between them), and how far stated sigmas are from actual errors. With each receiver left out: the
log-likelihood per epoch of its errors under what the others show, beside independent Gaussian models.
"""

from collections.abc import Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from scripts.common.command import ScriptParser
from scripts.common.markdown import table
from scripts.common.receivers import Series, rtk_drive, septentrio, survey, ublox
from scripts.common.results import Results
from vgps.config import Config
from vgps.model import FixClass, FloatArray
from vgps.survey import ErrorSeries, Memory, survey_errors

RECEIVERS = {"survey": survey, "rtk_drive": rtk_drive, "septentrio": septentrio, "ublox": ublox}
KEYS = ("r_m", "h_m", "noise_m", "walk_m", "tail", "vertical", "correlation_s")
COARSE = (FixClass.DGPS, FixClass.SBAS, FixClass.SINGLE)  # without ambiguities: each may stand in for another
LEAST_EPOCHS = 20
LEAST_SPREAD = float(np.log(3.0))  # of a class that one receiver has
RADIUS_95, HEIGHT_95 = 2.448, 1.960  # sigmas to the radius in the plane and the half height that hold 95 %

Estimates = Mapping[tuple[str, FixClass], FloatArray]  # receiver, class -> values of KEYS


class Pooled(NamedTuple):
    """Geometric mean of ``KEYS`` over receivers and the standard deviation of the logarithms between them."""

    mean: FloatArray
    spread: FloatArray
    receivers: int


def main() -> None:
    """Print the tables of receivers, of what they share, and of receivers left out."""
    parser = ScriptParser("experiments.receiver_priors", __doc__)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the logs")
    given = parser.parse_args()
    with parser.refusals():
        every = {name: read(given.data) for name, read in RECEIVERS.items()}
        results = parser.results(given)
    own = {
        (name, one.fix_class): np.array([one.r_m, one.h_m, *astuple(one.memory), one.correlation_s])
        for name, series in every.items()
        for one in survey_errors([series.errors])
        if one.epochs >= LEAST_EPOCHS and one.memory is not None
    }
    _print_constants(own, results)
    _print_stated(every, own, results)
    _print_left_out(every, own, results)


def pool(values: Sequence[FloatArray]) -> Pooled:
    """Pool the constants of several receivers, each counting once."""
    logs = np.log(values)
    spread = logs.std(axis=0, ddof=1) if len(logs) > 1 else np.full(logs.shape[1], LEAST_SPREAD)
    return Pooled(np.exp(logs.mean(axis=0)), spread, len(logs))


def pooled_without(receiver: str, fix_class: FixClass, own: Estimates) -> Pooled | None:
    """Return what other receivers show of a class, or of a class without ambiguities if none has this one."""
    like = COARSE if fix_class in COARSE else ()
    for classes in ((fix_class,), like):
        others = [found for (name, other), found in own.items() if name != receiver and other in classes]
        if others:
            return pool(others)
    return None


def stated_factors(errors: ErrorSeries, constants: FloatArray) -> FloatArray:
    """Return (2,) actual over stated size of the errors of a class, horizontal and vertical, or NaN."""
    east_m, north_m, up_m = errors.sigma_m.T
    stated_m = np.array([np.median(np.hypot(east_m, north_m)) / np.sqrt(2.0), np.median(up_m)])
    factors: FloatArray = constants[:2] / (np.array([RADIUS_95, HEIGHT_95]) * stated_m)
    return factors


def log_likelihood(errors: ErrorSeries, constants: FloatArray) -> FloatArray:
    """Return (N,) log densities of errors of a class under the model with memory, per m^3.

    The first error, and each after a gap, has the density of its region, any other one that of its change.
    """
    found = gaussian(errors, region_sigma(constants))
    step_s = np.diff(errors.t_s)
    usual_s = float(np.median(step_s))
    follows = 1 + np.flatnonzero(np.abs(step_s - usual_s) < 0.5 * usual_s)
    memory = Memory(**dict(zip(KEYS[2:6], map(float, constants[2:6]), strict=True)))
    found[follows] = memory.log_density(usual_s, errors.error_m[follows] - errors.error_m[follows - 1])
    return found


def region_sigma(constants: FloatArray) -> FloatArray:
    """Return the sigmas (3,) whose 95 % are the region."""
    return constants[[0, 0, 1]] / (RADIUS_95, RADIUS_95, HEIGHT_95)


def gaussian(errors: ErrorSeries, sigma_m: FloatArray) -> FloatArray:
    """Return (N,) log densities of independent Gaussian errors."""
    found: FloatArray = np.sum(norm.logpdf(errors.error_m, scale=sigma_m), axis=1)
    return found


def _print_constants(own: Estimates, results: Results) -> None:
    rows = []
    for (receiver, name), found in own.items():
        results.add(
            table="receivers", receiver=receiver, fix_class=name, **dict(zip(KEYS, found, strict=True))
        )
        rows.append([receiver, name, *(f"{value:.3g}" for value in found)])
    for name in FixClass:
        pooled = [found for (_, other), found in own.items() if other is name]
        if pooled:
            mean, spread, count = pool(pooled)
            pairs = {key: [value, sd] for key, value, sd in zip(KEYS, mean, spread, strict=True)}
            results.add(table="pooled", receivers=count, fix_class=name, **pairs)
            cells = (f"{value:.3g} x/ {np.exp(sd):.1f}" for value, sd in zip(mean, spread, strict=True))
            rows.append([f"pooled over {count}", name, *cells])
    print(table(["receiver", "class", *KEYS], rows))


def _print_stated(every: Mapping[str, Series], own: Estimates, results: Results) -> None:
    rows, factors = [], []
    for (receiver, name), constants in own.items():
        found = stated_factors(every[receiver].errors.of_class(name), constants)
        if np.isfinite(found).all():
            factors.append(found)
            rows.append([receiver, name, *(f"{factor:.2f}" for factor in found)])
            results.add(
                table="stated", receiver=receiver, fix_class=name, horizontal=found[0], vertical=found[1]
            )
    logs = np.log(factors)
    mean, spread = np.exp(logs.mean(axis=0)), logs.std(axis=0, ddof=1)
    results.summarise(stated_factor=mean, stated_factor_log_sd=spread)
    rows.append(["all", "", *(f"{a:.2f} x/ {np.exp(b):.1f}" for a, b in zip(mean, spread, strict=True))])
    print("\n" + table(["receiver", "class", "actual / stated horizontal", "vertical"], rows))


def _print_left_out(every: Mapping[str, Series], own: Estimates, results: Results) -> None:
    rows = []
    for (receiver, name), constants in own.items():
        errors, pooled = every[receiver].errors.of_class(name), pooled_without(receiver, name, own)
        if pooled is None:
            continue
        stated = np.maximum(errors.sigma_m, Config().gps.min_sigma_m)
        found = {
            "memory_of_others": log_likelihood(errors, pooled.mean).mean(),
            "memory_own": log_likelihood(errors, constants).mean(),
            "stated_sigmas": gaussian(errors, stated).mean(),
            "region_of_others": gaussian(errors, region_sigma(pooled.mean)).mean(),
            "region_own": gaussian(errors, region_sigma(constants)).mean(),
        }
        results.add(table="left_out", receiver=receiver, fix_class=name, others=pooled.receivers, **found)
        rows.append([receiver, name, str(pooled.receivers), *(f"{value:.2f}" for value in found.values())])
    columns = ["memory of others", "own memory", "stated sigmas", "region of others", "own region"]
    print("\nLog-likelihood per epoch, natural logarithm of 1/m^3:\n")
    print(table(["left out", "class", "others", *columns], rows))


if __name__ == "__main__":
    main()
