"""Draw a run: the path from above with fixes and their regions, and its error over time."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from scripts.common.command import ScriptParser
from scripts.common.recordings import true_poses
from vgps.readers.run_folder import read_run
from vgps.solution import Solution, Verdict

COLOURS = {"rtk_fix": "tab:green", "rtk_float": "tab:orange"}


def draw_fixes(axes: Axes, solution: Solution) -> None:
    """Draw the fixes from above: used ones with their regions, rejected ones with their residuals."""
    if solution.gps is None or solution.fixes is None:
        return
    table = solution.fixes
    for name in sorted(set(solution.gps.fix_class)):
        colour = COLOURS.get(name, "tab:red")
        used = table.used & np.array([fix == name for fix in solution.gps.fix_class])
        fixes = table.world_p_fix[used]
        axes.plot(fixes[:, 0], fixes[:, 1], "x", c=colour, ms=4, label=f"{name} fix and its region")
        for centre, r_m in zip(fixes, table.r_m[used], strict=True):
            region = Circle((centre[0], centre[1]), r_m, fill=False, ec=colour, lw=0.5, alpha=0.5)
            axes.add_patch(region)
    rejected = np.array([verdict is Verdict.REJECTED for verdict in table.verdict])
    if rejected.any():
        wrong, residual = table.world_p_fix[rejected], table.residual_m[rejected]
        for fix, offset in zip(wrong, residual, strict=True):
            axes.plot(*np.stack([fix, fix + offset])[:, :2].T, "-", c="tab:red", lw=0.8)
        axes.plot(wrong[:, 0], wrong[:, 1], "X", c="tab:red", ms=6, label="rejected fix")


def main() -> None:
    """Draw it."""
    parser = ScriptParser("tools.plot_run", __doc__, measures=False)
    parser.add_argument("run", type=Path, help="run folder")
    parser.add_argument("--out", type=Path, required=True, help="picture")
    parser.add_argument("--truth", type=Path, help="truth.tum")
    given = parser.parse_args()
    with parser.refusals():
        solution = read_run(given.run)
        true = true_poses(solution, given.run, given.truth)[:, :3, 3] if given.truth else None
    path = solution.world_T_camera[:, :3, 3]
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    above, error = figure.subplots(1, 2, width_ratios=[3, 2])
    above.scatter(*solution.landmarks.world_p_landmark[:, :2].T, s=0.5, c="0.8", zorder=0)
    draw_fixes(above, solution)
    above.plot(path[:, 0], path[:, 1], c="tab:blue", label="estimated camera path")
    margin = 3.0 + 0.05 * np.ptp(path[:, :2], axis=0).max()
    low, high = path[:, :2].min(axis=0) - margin, path[:, :2].max(axis=0) + margin
    above.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="east [m]", ylabel="north [m]")
    above.set_aspect("equal")
    error.plot(solution.t_s, solution.sigma_position_m.max(axis=1), c="0.6", label="largest sigma")
    if true is not None:
        above.plot(true[:, 0], true[:, 1], "k:", label="true path")
        error.plot(solution.t_s, np.linalg.norm(path - true, axis=1), c="tab:blue", label="unaligned error")
    error.set(xlabel="time [s]", ylabel="[m]", ylim=(0, None))
    above.legend(fontsize=8)
    error.legend(fontsize=8)
    figure.savefig(given.out, dpi=110)


if __name__ == "__main__":
    main()
