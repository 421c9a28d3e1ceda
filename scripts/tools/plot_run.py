"""A picture of a run: the path from above with fixes and their regions, and its error over time."""

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np

from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Verdict

mpl.use("Agg")
import matplotlib.pyplot as plt

COLOURS = {"rtk_fix": "tab:green", "rtk_float": "tab:orange"}


def main() -> None:
    """Draw it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--truth", type=Path)
    given = parser.parse_args()
    solution = read_run(given.run)
    path = solution.world_T_camera[:, :3, 3]
    figure, (above, error) = plt.subplots(1, 2, figsize=(11, 4.5), width_ratios=[3, 2], layout="constrained")
    above.scatter(*solution.landmarks.world_p_landmark[:, :2].T, s=0.5, c="0.8", zorder=0)
    if solution.gps is not None and solution.fixes is not None:
        for name in sorted(set(solution.gps.fix_class)):
            rows = np.array([fix == name for fix in solution.gps.fix_class])
            colour = COLOURS.get(name, "tab:red")
            used = rows & solution.fixes.used
            fixes = solution.fixes.world_p_fix[used]
            above.plot(fixes[:, 0], fixes[:, 1], "x", c=colour, ms=4, label=f"{name} fix and its region")
            for centre, r_m in zip(fixes, solution.fixes.r_m[used], strict=True):
                above.add_patch(plt.Circle(centre[:2], r_m, fill=False, ec=colour, lw=0.5, alpha=0.5))
        rejected = np.array([verdict is Verdict.REJECTED for verdict in solution.fixes.verdict])
        if rejected.any():
            wrong, residual = solution.fixes.world_p_fix[rejected], solution.fixes.residual_m[rejected]
            for fix, offset in zip(wrong, residual, strict=True):
                above.plot(*np.stack([fix, fix + offset])[:, :2].T, "-", c="tab:red", lw=0.8)
            above.plot(wrong[:, 0], wrong[:, 1], "X", c="tab:red", ms=6, label="rejected fix")
    above.plot(path[:, 0], path[:, 1], c="tab:blue", label="estimated camera path")
    margin = 3.0 + 0.05 * np.ptp(path[:, :2], axis=0).max()
    low, high = path[:, :2].min(axis=0) - margin, path[:, :2].max(axis=0) + margin
    above.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="east [m]", ylabel="north [m]")
    above.set_aspect("equal")
    error.plot(solution.t_s, solution.sigma_position_m.max(axis=1), c="0.6", label="largest sigma")
    if given.truth:
        truth = read_trajectory(given.truth).world_T_camera[: len(path), :3, 3]
        above.plot(truth[:, 0], truth[:, 1], "k:", label="true path")
        error.plot(solution.t_s, np.linalg.norm(path - truth, axis=1), c="tab:blue", label="unaligned error")
    error.set(xlabel="time [s]", ylabel="[m]", ylim=(0, None))
    above.legend(fontsize=8)
    error.legend(fontsize=8)
    figure.savefig(given.out, dpi=110)


if __name__ == "__main__":
    main()
