from itertools import product

import numpy as np
import pytest
from synthetic_fixes import fixes_at

from vgps.config import Config
from vgps.gps.fix_states import (
    LOWER,
    NOMINAL,
    OUTLIER,
    REPEATED_LOWER,
    REPEATED_OUTLIER,
    state_probabilities,
)

CONFIG = Config()
JUDGE = CONFIG.outliers
FIX, FLOAT = (0.07, 0.05), (2.4, 6.5)


def density(offset, r_m, h_m):
    """Return the density of one fix in the state NOMINAL, without its prior."""
    own, likelihood = state_probabilities(np.array([offset]), fixes_at(np.zeros(1), r_m, h_m), CONFIG)
    return own[0, NOMINAL] * np.exp(likelihood) / (1.0 - JUDGE.outlier_share)


def by_enumeration(offset, has_lower):
    """Sum over all sequences of states, by the definition of the model."""
    bad = 1.0 / (2.0 * np.pi * JUDGE.outlier_radius_m**3)
    lasts = JUDGE.persistence
    total = np.zeros((len(offset), 5))
    for states in product(range(5), repeat=len(offset)):
        weight = 1.0
        for k, state in enumerate(states):
            low = JUDGE.lower_share if has_lower[k] else 0.0
            prior = [1.0 - JUDGE.outlier_share - low, low, JUDGE.outlier_share, 0.0, 0.0]
            before = states[k - 1] if k else NOMINAL
            still = (
                {LOWER: REPEATED_LOWER, REPEATED_LOWER: REPEATED_LOWER}.get(before) if has_lower[k] else None
            )
            still = REPEATED_OUTLIER if before in {OUTLIER, REPEATED_OUTLIER} else still
            goes_on = lasts if still is not None else 0.0
            weight *= (1.0 - goes_on) * prior[state] + goes_on * (state == still)
            if not weight:
                break
            regions = [FIX if lower else FLOAT for lower in has_lower]
            if state in {NOMINAL, LOWER}:
                weight *= density(offset[k], *(regions[k] if state == NOMINAL else FLOAT))
            elif state == OUTLIER:
                weight *= bad
            else:
                weight *= density(offset[k] - offset[k - 1], *np.hypot(regions[k], regions[k - 1]))
        for k, state in enumerate(states):
            total[k, state] += weight
    return total / total.sum(axis=1, keepdims=True), np.log(total[0].sum())


@pytest.mark.parametrize("seed", range(3))
def test_forward_and_backward_are_the_sum_over_all_sequences(seed):
    rng = np.random.default_rng(seed)
    has_lower = np.array([True, True, False, True])
    offset = rng.normal(0, [0.05, 0.05, 0.03], (4, 3))
    offset[1:3] += [2.0, 1.0, 0.5] if seed else [20.0, 1.0, 0.5]
    r, h = np.where(has_lower, FIX[0], FLOAT[0]), np.where(has_lower, FIX[1], FLOAT[1])
    lower = [np.where(has_lower, size, np.nan) for size in FLOAT]
    fixes = fixes_at(np.arange(4.0), r, h, lower=lower)
    found, likelihood = state_probabilities(offset, fixes, CONFIG)
    expected, log_total = by_enumeration(offset, has_lower)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert likelihood == pytest.approx(log_total, abs=1e-9)


def test_six_wrong_fixes_that_agree_count_as_one_error():
    t_s, one_off = np.arange(6.0), np.array([15.0, -9.0, 4.0])
    rng = np.random.default_rng(0)
    fixes = fixes_at(t_s, *FIX, lower=FLOAT)
    _, single = state_probabilities(one_off[None], fixes.where(t_s < 1.0), CONFIG)
    found, together = state_probabilities(one_off + rng.normal(0, 0.01, (6, 3)), fixes, CONFIG)
    apart = rng.permuted(np.tile(one_off, (6, 1)), axis=1) * rng.choice([-1, 1], (6, 3))
    scattered, six = state_probabilities(apart, fixes, CONFIG)
    assert together > single and six < 5 * single
    assert found[1:, REPEATED_OUTLIER].min() > 0.99 and found[0, OUTLIER] > 0.99
    assert scattered[:, NOMINAL].max() < 1e-6


def test_a_fix_without_a_class_below_is_never_down_classed():
    t_s = np.arange(2.0)
    lower = [np.array([size, np.nan]) for size in FLOAT]
    r, h = np.array([FIX[0], FLOAT[0]]), np.array([FIX[1], FLOAT[1]])
    found, _ = state_probabilities(np.tile([1.0, 0.0, 0.0], (2, 1)), fixes_at(t_s, r, h, lower=lower), CONFIG)
    assert (
        found[0, LOWER] > 0.9 and found[1, [LOWER, REPEATED_LOWER]].max() == 0.0 and found[1, NOMINAL] > 0.9
    )
