"""Plots and verdicts, read back from a saved recording."""

import pytest
from reading_back import Logged


def test_plots_hold_the_numbers(logged: Logged) -> None:
    (largest,) = logged.rows("/plots/reprojection_px/largest", "Scalars:scalars")[0]
    assert largest == pytest.approx(1.0)
    sigma = [row[0] for row in logged.rows("/plots/sigma_m/up", "Scalars:scalars")]
    assert sigma == [0.125] * 6
    degrees = [row[0] for row in logged.rows("/plots/sigma_deg/east", "Scalars:scalars")]
    assert degrees == pytest.approx([0.25] * 6)
    assert logged.rows("/plots/residual_over_region/rejected", "Scalars:scalars") == [[3.0]]  # of 300


def test_verdicts_are_logged_with_their_severity(logged: Logged) -> None:
    texts = [text for (text,) in logged.rows("/verdicts", "TextLog:text")]
    assert len(texts) == 5
    assert texts[3] == "fix 3, rtk_fix: rejected: because 3"
    assert [level for (level,) in logged.rows("/verdicts", "TextLog:level")] == [
        "INFO",
        "INFO",
        "WARN",
        "ERROR",
        "DEBUG",
    ]
