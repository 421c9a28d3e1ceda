"""The plot of the path."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection

from vgps.report import path_plot as module
from vgps.report.path_plot import _MAX_HEIGHT, _MIN_HEIGHT, _WIDTH, fixes_outside, path_plot


def labels(axes):
    return axes.get_legend_handles_labels()[1]


def test_distant_fixes_do_not_shrink_the_plot_and_are_counted(solution):
    far = solution.fixes.world_p_fix.copy()
    far[3] += [0.0, 50_000.0, 0.0]
    run = replace(solution, fixes=replace(solution.fixes, world_p_fix=far))
    assert (fixes_outside(solution), fixes_outside(run)) == (0, 1)
    limits = [path_plot(one).axes[0].get_ylim() for one in (solution, run)]
    assert limits[0] == pytest.approx(limits[1], abs=100.0)


def test_the_plot_holds_regions_but_not_those_much_larger_than_the_path(solution):
    def limits(r_m):
        table = replace(solution.fixes, r_m=np.full(len(solution.fixes.r_m), r_m))
        above = path_plot(replace(solution, fixes=table)).axes[0]
        return np.array([above.get_xlim(), above.get_ylim()])

    fixes = solution.fixes.world_p_fix[:, :2]
    r_m = 0.2 * float(np.ptp(fixes, axis=0).max())
    assert (limits(r_m)[:, 0] <= fixes.min(axis=0) - r_m).all()
    assert (limits(r_m)[:, 1] >= fixes.max(axis=0) + r_m).all()
    assert np.ptp(limits(100.0 * r_m), axis=1).max() < 2.0 * np.ptp(limits(r_m), axis=1).max()


@pytest.mark.parametrize("turn", [0.0, 0.5 * np.pi])
def test_the_plot_of_a_straight_path_is_neither_flat_nor_tall(solution, turn):
    poses = solution.world_T_camera.copy()
    poses[:, :2, 3] = poses[:, :1, 3] * [np.cos(turn), np.sin(turn)]
    figure = path_plot(replace(solution, world_T_camera=poses, gps=None, fixes=None))
    low, high = np.array([figure.axes[0].get_xlim(), figure.axes[0].get_ylim()]).T
    wide, tall = high - low
    assert _WIDTH / _MAX_HEIGHT - 1e-6 <= wide / tall <= _WIDTH / _MIN_HEIGHT + 1e-6
    assert figure.get_figheight() == pytest.approx(3.2 + (_MAX_HEIGHT if turn else _MIN_HEIGHT))


def test_the_legend_names_what_is_shown(solution):
    above, side = path_plot(solution).axes
    assert {"camera", "start", "landmarks", "fixes rejected: 1", "regions of used fixes"} <= set(
        labels(above)
    )
    assert set(labels(side)) >= {"camera", "antenna", "fixes rejected", "fixes down-classed"}
    assert "before stage D" not in labels(above)
    kept = replace(solution, world_p_before=solution.world_T_camera[:, :3, 3] + 1.0)
    assert "before stage D" in labels(path_plot(kept).axes[0])


def test_regions_have_their_true_size(solution):
    above = path_plot(solution).axes[0]
    regions = [one for one in above.collections if isinstance(one, EllipseCollection)]
    rejected = regions[-1] if len(regions[-1].get_offsets()) == 1 else regions[-2]
    assert sorted(len(one.get_offsets()) for one in regions)[:2] == [1, 1]
    assert rejected.get_widths() == pytest.approx([0.2])  # twice r


def test_a_long_run_is_drawn_as_pixels(solution, monkeypatch):
    assert path_plot(solution).axes[0].get_rasterization_zorder() is None
    monkeypatch.setattr(module, "_MAX_VECTORS", 100)
    assert path_plot(solution).axes[0].get_rasterization_zorder() is not None
