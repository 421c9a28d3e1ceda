from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import TIGHT
from synthetic_rows import ROWS, rolling_drive

from vgps.camera import row_shares
from vgps.config import Config
from vgps.errors import GeometryError
from vgps.model import Camera
from vgps.smoothing.calibration import readout
from vgps.smoothing.calibration.readout import Readout, estimate_readout
from vgps.smoothing.context import SmoothingContext
from vgps.solver.bundle_adjustment import solve
from vgps.solver.problem import BundleProblem

CAMERA = Camera(model="pinhole", width=640, height=ROWS, fx=500.0, fy=510.0, cx=320.0, cy=240.0)
NO_SIGMA = np.zeros(4)
T_S = 0.1 * np.arange(40) + 0.004 * np.sin(np.arange(40))


def optimum(problem: BundleProblem) -> BundleProblem:
    return solve(replace(problem, sigma_px=np.full_like(problem.sigma_px, 0.5)), TIGHT).problem


def test_rows_lie_in_the_distorted_picture() -> None:
    lens = replace(CAMERA, model="opencv", distortion=(-0.1, 0.0, 0.0, 0.0))
    uv = np.array([[320.0, 239.5], [320.0, 0.0], [320.0, 479.0], [320.0, 600.0]])
    np.testing.assert_allclose(row_shares(CAMERA, uv), [0.0, -0.5, 0.5, 0.5], atol=1e-12)
    middle, first, last, beyond = row_shares(lens, uv)
    assert abs(middle) < 1e-6 and -0.5 < first < -0.47 and 0.47 < last < 0.5 and beyond == 0.5
    turned = replace(CAMERA, readout_axis="columns")
    across = np.array([[0.0, 100.0], [319.5, 0.0], [639.0, 200.0]])
    np.testing.assert_allclose(row_shares(turned, across), [-0.5, 0.0, 0.5], atol=1e-12)


@pytest.mark.slow
def test_the_readout_is_found_from_a_global_shutter_and_from_itself() -> None:
    problem, _ = rolling_drive()
    rigid = optimum(replace(problem, row_times=None))
    found = estimate_readout(rigid, T_S, CAMERA, NO_SIGMA)
    assert found.readout_s == pytest.approx(0.06, abs=4 * found.sigma_s)
    assert found.sigma_s < 0.004 and found.is_shown(5.0)
    again = estimate_readout(optimum(problem), T_S, CAMERA, NO_SIGMA)
    assert again.readout_s == pytest.approx(0.06, abs=4 * again.sigma_s)
    uncertain = estimate_readout(rigid, T_S, CAMERA, np.array([0.1, 20.0, 20.0, 0.3]))
    assert uncertain.sigma_s > 2 * found.sigma_s and uncertain.readout_s == found.readout_s


@pytest.mark.slow
@pytest.mark.parametrize("rolls", [True, False])
def test_the_readout_of_many_chunks_is_that_of_one(rolls: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _ = rolling_drive()
    problem = problem if rolls else replace(problem, row_times=None)
    whole = estimate_readout(problem, T_S, CAMERA, NO_SIGMA)
    monkeypatch.setattr("vgps.solver.equations.chunks.CHUNK_OBSERVATIONS", 100)
    parts = estimate_readout(problem, T_S, CAMERA, NO_SIGMA)
    assert parts.readout_s == pytest.approx(whole.readout_s, rel=1e-6)
    assert parts.sigma_s == pytest.approx(whole.sigma_s, rel=1e-6)


def test_observations_in_the_middle_row_show_no_readout() -> None:
    problem, _ = rolling_drive()
    assert problem.row_times is not None
    middle = replace(problem.row_times, share=np.zeros_like(problem.row_times.share))
    with pytest.raises(GeometryError, match="nothing shows a readout"):
        estimate_readout(replace(problem, row_times=middle), T_S, CAMERA, NO_SIGMA)


@pytest.mark.slow
def test_the_sigma_holds() -> None:
    errors = []
    for seed in range(8):
        found = estimate_readout(optimum(rolling_drive(seed=seed)[0]), T_S, CAMERA, NO_SIGMA)
        errors.append((found.readout_s - 0.06) / found.sigma_s)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_a_given_readout_is_contradicted_by_what_cannot_be_chance() -> None:
    seen = Readout(0.010, 0.001, 0.033)
    given = {0.010: False, 0.014: False, -0.010: True, 0.0: True}  # 5 sigmas are 5 ms
    assert {each: seen.contradicts(each, 5.0) for each in given} == given
    exact = Readout(0.010, 1e-5, 0.033)
    assert not exact.contradicts(0.012, 5.0) and exact.contradicts(0.014, 5.0)  # a tenth of a frame is 3.3 ms
    assert not Readout(0.05, 1e-3, 0.033).contradicts(0.0, 5.0)  # longer than a frame


@pytest.mark.slow
def test_a_global_shutter_is_not_taken_for_a_rolling_one() -> None:
    problem, _ = rolling_drive(readout_s=1e-9)
    found = estimate_readout(optimum(replace(problem, row_times=None)), T_S, CAMERA, NO_SIGMA)
    assert abs(found.readout_s) < 4 * found.sigma_s and not found.is_shown(5.0) and found.would_show(5.0)


def test_what_an_estimate_shows() -> None:
    assert Readout(0.03, 0.005, 1 / 30).is_shown(5.0)
    assert not Readout(0.03, 0.007, 1 / 30).is_shown(5.0)
    assert not Readout(0.06, 0.001, 1 / 30).is_shown(5.0)  # longer than a frame
    assert Readout(-0.03, 0.001, 1 / 30).is_shown(5.0)  # the last row first
    assert not Readout(0.0, 0.01, 1 / 30).would_show(5.0)


def test_a_round_that_determines_no_readout_keeps_it(monkeypatch):
    def undetermined(*_):
        raise GeometryError("frame 1: its pose is not determined")

    monkeypatch.setattr(readout, "estimate_readout", undetermined)
    before = SmoothingContext(
        Camera(model="pinhole", width=8, height=6, fx=7.0, fy=7.0, cx=3.5, cy=2.5),
        Config(),
        estimates_readout=True,
    )
    assert readout.with_better_readout(before, None, np.zeros(0)) is before
