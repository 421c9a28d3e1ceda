"""Rates of frames beyond the path, from observations whose rows turned by known ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_bundle import K
from synthetic_rows import rolling_drive

from vgps.model import FloatArray
from vgps.smoothing.scene.frame_rates import frame_rates, turned_back
from vgps.solver.cost import camera_points
from vgps.solver.problem import BundleProblem

READOUT_S = 0.06


@pytest.fixture(scope="module")
def still() -> BundleProblem:
    """A drive at its true poses and points, observed without noise."""
    return rolling_drive(READOUT_S, noise_px=0.0, disturbed=0.0)[0]


def turning(problem: BundleProblem, rates: FloatArray) -> BundleProblem:
    """The problem as observed by frames that turn at these rates beside the path."""
    assert problem.row_times is not None
    turn = (READOUT_S * problem.row_times.share)[:, None] * rates[problem.frame]
    x, y, z = Rotation.from_rotvec(-turn).apply(camera_points(problem).T).T
    return replace(problem, uv_px=np.stack([K[0] * x / z + K[2], K[1] * y / z + K[3]], axis=1))


def test_observations_are_turned_back_to_the_path(still: BundleProblem) -> None:
    rates = np.random.default_rng(1).normal(0.0, 0.1, (len(still.world_T_camera), 3))
    seen = turning(still, rates)
    moved = np.abs(seen.uv_px - still.uv_px).max()
    back = turned_back(seen, rates).uv_px
    assert moved > 3.0 and np.abs(back - still.uv_px).max() < 0.05 * moved
    np.testing.assert_array_equal(turned_back(seen, None).uv_px, seen.uv_px)
    np.testing.assert_array_equal(turned_back(replace(seen, row_times=None), rates).uv_px, seen.uv_px)


def test_rates_are_found_in_one_step_and_kept_in_the_next(still: BundleProblem) -> None:
    rates = np.random.default_rng(1).normal(0.0, 0.1, (len(still.world_T_camera), 3))
    seen = turning(still, rates)
    noisy = replace(seen, uv_px=seen.uv_px + np.random.default_rng(2).normal(0.0, 0.1, seen.uv_px.shape))
    found = frame_rates(noisy, None)
    assert np.sqrt(np.mean((found - rates) ** 2)) < 0.15 * 0.1
    np.testing.assert_allclose(frame_rates(turned_back(noisy, found), found), found, atol=0.01)


def test_noise_alone_shows_hardly_any_rates(still: BundleProblem) -> None:
    noise = np.random.default_rng(2).normal(0.0, 0.3, still.uv_px.shape)
    found = frame_rates(replace(still, uv_px=still.uv_px + noise), None)
    assert np.sqrt(np.mean(found**2)) < 0.01


def test_a_frame_that_sees_little_and_a_global_shutter_have_none(still: BundleProblem) -> None:
    rates = np.full((len(still.world_T_camera), 3), 0.1)
    seen = turning(still, rates)
    few = (seen.frame != 5) | (np.cumsum(seen.frame == 5) <= 5)
    problem = replace(
        seen,
        **{name: getattr(seen, name)[few] for name in ("frame", "landmark", "uv_px", "sigma_px")},
        row_times=seen.row_times.rows(np.flatnonzero(few)),
    )
    found = frame_rates(problem, None)
    assert not found[5].any() and np.abs(found[4]).min() > 0.05
    assert not frame_rates(replace(seen, row_times=None), None).any()
