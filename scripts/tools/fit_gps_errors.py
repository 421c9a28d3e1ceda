"""Fit sigma and correlation time of a receiver's errors per fix class and axis: what the simulator needs.

The processes are first-order Gauss-Markov about the truth: the mean of the RTK-fix epochs of a receiver that
stands still, or with --reference a better solution of the same drive where that is RTK-fix.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from scripts.common.command import ScriptParser
from scripts.common.markdown import table
from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.simulate.receiver_errors import axes
from vgps.simulate.sensor_config import FIX_ERRORS
from vgps.survey import read_errors

LEAST_EPOCHS = 5
AXES = ("east", "north", "up")


def main() -> None:
    """Print a markdown table, the simulator's own numbers beside it."""
    parser = ScriptParser("tools.fit_gps_errors", __doc__, measures=False)
    parser.add_argument("log", type=Path, help="of a receiver that stands still, unless there is --reference")
    parser.add_argument("--reference", type=Path, help="a better log of the same drive")
    given = parser.parse_args()
    with parser.refusals():
        series = read_errors(given.log, given.reference)
        counts = Counter(series.fix_class)
        classes = [one for one in FixClass if one is not FixClass.UNKNOWN and counts[one] >= LEAST_EPOCHS]
        if not classes:
            found = ", ".join(f"{count} {name}" for name, count in counts.items())
            expected = f"{LEAST_EPOCHS} epochs of a known class"
            raise GpsLogError(f"{found} epochs", file=given.log, expected=expected)
    rows = []
    for name in classes:
        own, model = series.of_class(name), FIX_ERRORS.get(name)
        for axis, fitted in enumerate(axes(own)):
            stated = own.sigma_m[:, axis]
            sigma_m = np.nanmedian(stated) if np.isfinite(stated).any() else np.nan
            rows.append(
                [
                    f"{name} {AXES[axis]}",
                    str(counts[name]),
                    f"{own.error_m[:, axis].mean():.3f}",
                    f"{fitted.sigma_m:.3f} ± {100 * fitted.sigma_doubt:.0f} %",
                    f"{fitted.correlation_s:.0f}",
                    f"{sigma_m:.3f}",
                    "" if model is None else f"{model.total_m[axis]:.3f} m, {model.correlation_s:.0f} s",
                ]
            )
    columns = ["class, axis", "epochs", "mean [m]", "sigma [m]", "T [s]", "receiver's own sigma [m]"]
    print(table([*columns, "simulator"], rows))


if __name__ == "__main__":
    main()
