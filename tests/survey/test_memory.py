import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, multivariate_t

from vgps.model import FixClass
from vgps.survey import Memory, find_changes, find_stretches, fit_memory

FIX, FLOAT = FixClass.RTK_FIX, FixClass.RTK_FLOAT
CLASSES = st.lists(st.sampled_from([FIX, FLOAT]), min_size=1, max_size=40)


def simulated(memory: Memory, count: int, seed: int) -> np.ndarray:
    """Errors (count, 3) at 1 Hz of a receiver with this memory."""
    rng = np.random.default_rng(seed)
    step = multivariate_t(np.zeros(3), np.eye(3), df=memory.tail).rvs(count, random_state=rng)
    error = np.cumsum(memory.walk_m * step, axis=0) + rng.normal(0, memory.noise_m, (count, 3))
    return error * [1.0, 1.0, memory.vertical]


def fitted(error_m: np.ndarray, step_s: float = 1.0, length: int = 100) -> Memory:
    """The memory fitted to stretches of this length."""
    rows = np.arange(len(error_m))
    return fit_memory(find_changes(step_s * rows, error_m, rows // length))


@pytest.mark.parametrize("tail", [0.5, 1.0, 3.0, 30.0])
def test_without_noise_a_change_over_a_second_is_student_t(tail):
    shape = np.diag([0.02**2, 0.02**2, 0.05**2])
    oracle = multivariate_t(np.zeros(3), shape, df=tail)
    change = oracle.rvs(500, random_state=np.random.default_rng(0))
    change = change[np.linalg.norm(change, axis=1) < 100.0]
    memory = Memory(noise_m=1e-6, walk_m=0.02, tail=tail, vertical=2.5)
    np.testing.assert_allclose(memory.log_density(1.0, change), oracle.logpdf(change), atol=0.01)


def test_changes_of_a_cauchy_walk_grow_with_time():
    change = np.random.default_rng(0).normal(0, 0.3, (100, 3))
    oracle = multivariate_t(np.zeros(3), 0.1**2 * np.eye(3), df=1).logpdf(change)
    memory = Memory(noise_m=1e-6, walk_m=0.02, tail=1.0, vertical=1.0)
    np.testing.assert_allclose(memory.log_density(5.0, change), oracle, atol=0.01)


def test_without_a_walk_a_change_is_the_noise_of_both_its_ends():
    change = np.random.default_rng(0).normal(0, 0.03, (100, 3))
    oracle = multivariate_normal(np.zeros(3), 2 * 0.02**2 * np.diag([1, 1, 4])).logpdf(change)
    memory = Memory(noise_m=0.02, walk_m=1e-7, tail=3.0, vertical=2.0)
    np.testing.assert_allclose(memory.log_density(10.0, change), oracle, atol=0.01)


def test_changes_over_several_seconds_are_distributed_as_simulated():
    memory = Memory(noise_m=0.02, walk_m=0.03, tail=2.0, vertical=1.0)
    error = simulated(memory, 30_000, seed=0)
    length = np.linalg.norm(error[3::3] - error[:-3:3], axis=1)
    radius = np.linspace(0.0, 0.5, 2001)
    density = np.exp(memory.log_density(3.0, radius[:, None] * [1.0, 0.0, 0.0]))
    share = np.cumsum(4 * np.pi * radius**2 * density) * radius[1]
    for limit in (0.05, 0.1, 0.2, 0.4):
        assert np.interp(limit, radius, share) == pytest.approx(np.mean(length < limit), abs=0.015)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise_m", "walk_m", "tail", "vertical"),
    [(0.002, 0.02, 1.0, 2.0), (0.01, 0.1, 8.0, 1.0), (0.005, 0.002, 4.0, 3.0)],
)
def test_constants_are_recovered(noise_m, walk_m, tail, vertical):
    """Within 25 % (tail: 40 %) in the median of three seeds of 1,500 epochs, each within 1.8 times."""
    true = Memory(noise_m=noise_m, walk_m=walk_m, tail=tail, vertical=vertical)
    found = [fitted(simulated(true, 1500, seed)) for seed in range(3)]
    # noise far below the walk shows in no change: only that it is small is found
    names = ["walk_m", "tail", "vertical", *(["noise_m"] if noise_m > 0.2 * walk_m else [])]
    for name in names:
        ratios = np.array([getattr(one, name) for one in found]) / getattr(true, name)
        limit = 1.4 if name == "tail" else 1.25
        assert abs(np.log(np.median(ratios))) < np.log(limit), (name, ratios)
        assert np.abs(np.log(ratios)).max() < np.log(1.8), (name, ratios)
    assert max(one.noise_m for one in found) < max(1.25 * noise_m, 0.3 * walk_m)


@pytest.mark.slow
def test_a_fast_log_shows_the_same_walk():
    """Changes of a Cauchy walk over 0.1 s are Cauchy with a tenth of the scale."""
    rng = np.random.default_rng(1)
    step = multivariate_t(np.zeros(3), np.eye(3), df=1).rvs(3000, random_state=rng)
    found = fitted(np.cumsum(0.005 * step, axis=0), step_s=0.1, length=300)
    assert found.walk_m == pytest.approx(0.05, rel=0.15) and found.tail == pytest.approx(1.0, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.01, 1000.0])
def test_scaled_errors_have_scaled_constants(scale):
    error = simulated(Memory(noise_m=0.1, walk_m=0.2, tail=2.0, vertical=2.0), 300, seed=0)
    one, other = fitted(error), fitted(scale * error)
    assert other.noise_m == pytest.approx(scale * one.noise_m, rel=0.02)
    assert other.walk_m == pytest.approx(scale * one.walk_m, rel=0.02)
    assert (other.tail, other.vertical) == pytest.approx((one.tail, one.vertical), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3, 60])
def test_few_or_repeated_positions_do_not_degenerate(count):
    error = np.zeros((count, 3))
    error[count // 2 :, 0] = 0.18
    found = fitted(error)
    assert 1e-3 < found.noise_m < 0.3 and 1e-3 < found.walk_m < 1.0
    assert 0.5 <= found.tail <= 30 and 0.1 <= found.vertical <= 20
    still = fitted(np.zeros((count, 3)))
    assert 0.0 < still.noise_m < 1e-3 and 0.0 < still.walk_m < 1e-3


def test_stretches_end_with_the_class_with_a_gap_and_when_time_goes_back():
    t_s = np.array([0.0, 1.0, 2.0, 3.0, 14.0, 15.0, 0.0, 1.0])
    classes = [FIX, FIX, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT, FLOAT]
    assert find_stretches(t_s, classes, 10.0).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]


def test_changes_stay_within_stretches_and_skip_missing_epochs():
    t_s = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    error = t_s[:, None] * [1.0, 2.0, 3.0]
    one, two = find_changes(t_s, error, np.zeros(5, int))
    assert (one.lag_s, two.lag_s, one.weight, two.weight) == (1.0, 2.0, 1.0, 0.5)
    np.testing.assert_allclose(one.change_m, [[1, 2, 3]] * 3)
    np.testing.assert_allclose(two.change_m, [[2, 4, 6]])
    assert find_changes(t_s, error, np.arange(5)) == []


@pytest.mark.slow
@given(CLASSES, st.sampled_from([0.1, 0.5, 1.0, 7.0]))
@settings(deadline=None)
def test_a_steady_drift_changes_as_its_time_says(classes, step_s):
    t_s = step_s * np.arange(len(classes))
    stretch = find_stretches(t_s, classes, 10.0)
    for one in find_changes(t_s, t_s[:, None] * [1.0, 0.0, 0.0], stretch):
        np.testing.assert_allclose(one.change_m[:, 0], one.lag_s)
        assert len(one.change_m) < len(classes) and one.weight * one.lag_s == pytest.approx(step_s)
