"""The plots over time."""

from dataclasses import replace

import numpy as np
import pytest

from vgps.report.time_plot import time_plot


def test_fixes_are_plotted_at_their_time_stamps_less_the_time_offset(solution):
    axes = time_plot(solution).axes[0]
    (rejected,) = (line for line in axes.lines if line.get_label() == "fixes rejected")
    np.testing.assert_allclose(rejected.get_xdata(), [3.05 - 0.125])


@pytest.mark.slow
def test_outages_and_bridged_frames_are_shaded_and_named_once(solution):
    all_axes = time_plot(solution).axes
    labels = [label for axes in all_axes for label in axes.get_legend_handles_labels()[1]]
    assert labels.count("no fix used") == labels.count("frames bridged") == 1
    assert {len(axes.patches) for axes in all_axes} == {3}  # two outages, one run of bridged frames


@pytest.mark.slow
def test_without_fixes_there_are_no_ratios(solution):
    assert len(time_plot(solution).axes) == 5
    assert len(time_plot(replace(solution, gps=None, fixes=None)).axes) == 3
