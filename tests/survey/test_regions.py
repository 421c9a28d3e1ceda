import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vgps.survey import least_ellipsoid, region
from vgps.survey.regions import correlation_time, outside

errors = arrays(np.float64, st.tuples(st.integers(1, 60), st.just(3)), elements=st.floats(-20, 20))


def test_the_worst_of_each_is_dropped_on_its_own():
    own = np.array([[3.0, 4.0, 0.0], [0.0, 1.0, 9.0], [0.6, 0.8, -2.0], [0.0, 0.0, 1.0]])
    assert region(own, 0.0) == (5.0, 9.0)
    assert region(own, 0.25) == (1.0, 2.0)
    assert outside(own, 1.0, 2.0) == 2


@pytest.mark.slow
@given(errors, st.floats(0, 0.9), st.floats(0.1, 10))
def test_a_region_grows_with_its_errors_and_not_with_what_is_dropped(own, drop, scale):
    r_m, h_m = region(own, drop)
    assert np.allclose(region(scale * own, drop), (scale * r_m, scale * h_m))
    assert np.allclose(region(own[::-1], drop), (r_m, h_m))
    assert r_m <= region(own, 0.0)[0] and h_m <= region(own, 0.0)[1]
    assert outside(own, r_m, h_m) <= 2 * int(drop * len(own))


@pytest.mark.slow
@given(errors, st.integers(0, 10))
@example(np.array([[0.0, 1.0, 1.0], [1.0, 1.0, 0.0], *[[1.0, 1.0, 1.0]] * 10]), 10)  # least at a kink
@example(  # of two minima on the grid the worse one is the better one between
    np.array([*[[0.0, 1.0, 1.0]] * 8, [0.3, 1.0, 1.0], [1.0, 1.0, 0.0], *[[1.0, 1.0, 1.0]] * 9]), 10
)
@settings(deadline=None)
def test_the_ellipsoid_drops_as_asked_and_none_tried_is_smaller(own, dropped):
    dropped = min(dropped, len(own) - 1)
    found = least_ellipsoid(own, dropped)
    rho, z = np.hypot(own[:, 0], own[:, 1]), np.abs(own[:, 2])
    reach = np.hypot(rho / found.alpha_m, z / found.beta_m)
    assert np.count_nonzero(reach > 1 + 1e-6) <= dropped
    for ratio in np.geomspace(0.05, 20, 25):
        alpha = np.sort(np.hypot(rho, z / ratio))[len(own) - dropped - 1]
        assert found.alpha_m**2 * found.beta_m <= max(alpha, 1e-9) ** 3 * ratio * (1 + 1e-6)


@pytest.mark.slow
def test_correlation_time_of_a_gauss_markov_process():
    """Its autocorrelation is exp(-|lag| / T), whose integral is 2 T."""
    rng, keep = np.random.default_rng(0), np.exp(-1 / 10)
    x = np.zeros((40_000, 3))
    for i in range(1, len(x)):
        x[i] = keep * x[i - 1] + rng.normal(0, np.sqrt(1 - keep**2), 3)
    t_s = np.arange(len(x), dtype=float)
    assert correlation_time(t_s, x) == pytest.approx(20.0, rel=0.2)
    thinned = rng.random(len(x)) < 0.6
    assert correlation_time(t_s[thinned], x[thinned]) == pytest.approx(20.0, rel=0.25)
    assert correlation_time(t_s, rng.normal(size=x.shape)) == pytest.approx(1.0, rel=0.2)


def test_a_bias_is_one_error_however_long_it_is_measured():
    t_s = np.arange(300.0)
    assert correlation_time(t_s, np.full((300, 3), 2.0)) > 250.0
