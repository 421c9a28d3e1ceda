"""Sigma and correlation time of a receiver's errors, per fix class and axis: what the simulator needs.

The processes are first-order Gauss-Markov about the truth: the mean of the RTK-fix epochs of a receiver that
stands still, or a better solution of the same drive where that is RTK-fix.
"""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from vgps.errors import VgpsError
from vgps.model import FixClass
from vgps.simulate.receiver_errors import axes, read_errors
from vgps.simulate.scene import FIX_ERRORS

LEAST_EPOCHS = 5
AXES = ("east", "north", "up")


def main() -> None:
    """Print a markdown table, the simulator's own numbers beside it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("log", type=Path)
    parser.add_argument("--reference", type=Path)
    given = parser.parse_args()
    try:
        series = read_errors(given.log, given.reference)
    except VgpsError as error:
        parser.exit(2, f"fit_gps_errors: {error}\n")
    counts = Counter(series.fix_class)
    classes = [one for one in FixClass if one is not FixClass.UNKNOWN and counts[one] >= LEAST_EPOCHS]
    if not classes:
        found = ", ".join(f"{count} {name}" for name, count in counts.items())
        parser.exit(
            2, f"fit_gps_errors: {given.log}: {found}; expected {LEAST_EPOCHS} epochs of a known class\n"
        )
    print("| class, axis | epochs | mean [m] | sigma [m] | T [s] | receiver's own sigma [m] | simulator |")
    print("|---" * 7 + "|")
    for name in classes:
        own, model = series.of_class(name), FIX_ERRORS.get(name)
        for axis, fitted in enumerate(axes(own)):
            said = np.nanmedian(own.sigma_m[:, axis]) if np.isfinite(own.sigma_m[:, axis]).any() else np.nan
            simulated = "" if model is None else f"{model.total_m[axis]:.3f} m, {model.correlation_s:.0f} s"
            print(
                f"| {name} {AXES[axis]} | {counts[name]} | {own.error_m[:, axis].mean():.3f} "
                f"| {fitted.sigma_m:.3f} ± {100 * fitted.sigma_doubt:.0f} % | {fitted.correlation_s:.0f} "
                f"| {said:.3f} | {simulated} |"
            )


if __name__ == "__main__":
    main()
