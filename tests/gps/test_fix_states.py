from dataclasses import replace
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
    REPEATED_NOMINAL,
    REPEATED_OUTLIER,
    state_probabilities,
)
from vgps.gps.offset_errors import log_walk_density

CONFIG = Config()
JUDGE = CONFIG.outliers
FIX, FLOAT = (0.07, 0.05), (2.4, 6.5)


def density(offset, r_m, h_m):
    """Return the density of one fix in the state NOMINAL, without its prior."""
    own, likelihood = state_probabilities(np.array([offset]), fixes_at(np.zeros(1), r_m, h_m), CONFIG)
    return own[0, NOMINAL] * np.exp(likelihood[0]) / (1.0 - JUDGE.outlier_share)


def walked(offset, k, fixes, config):
    """Return the density of fix k if its class's error goes on from the fix before."""
    step = log_walk_density(offset[k : k + 1] - offset[k - 1 : k], fixes.where([k - 1, k]), config.gps)
    regions = [(fixes.r_m[row], fixes.h_m[row]) for row in (k - 1, k)]
    farther = density(offset[k], *regions[1]) / density(offset[k - 1], *regions[0])
    return np.exp(step[0]) * min(farther, 1.0)


def repeated(offset, k, fixes, regions, config):
    """Return the density of fix k if it has the wrong error of the fix before."""
    step, interval_s = offset[k] - offset[k - 1], min(fixes.t_s[k] - fixes.t_s[k - 1], 1.0)
    anew = density(step, *np.hypot(regions[k], regions[k - 1]))
    if not config.gps.has_memory or fixes.fix_class[k] != fixes.fix_class[k - 1]:
        return anew
    within = anew / density(np.zeros(3), *np.hypot(regions[k], regions[k - 1]))
    going_on = within * np.exp(log_walk_density(step[None], fixes.where([k - 1, k]), config.gps)[0])
    return interval_s * anew + (1.0 - interval_s) * going_on


def by_enumeration(offset, fixes, config):
    """Sum over all sequences of states, by the definition of the model."""
    bad = 1.0 / (2.0 * np.pi * JUDGE.outlier_radius_m**3)
    has_lower, total = np.isfinite(fixes.lower_r_m), np.zeros((len(offset), 6))
    for states in product(range(6), repeat=len(offset)):
        weight = 1.0
        for k, state in enumerate(states):
            low = JUDGE.lower_share if has_lower[k] else 0.0
            good, bad_share = 1.0 - JUDGE.outlier_share - low, JUDGE.outlier_share
            prior = np.array([good, low, bad_share, 0.0, 0.0, 0.0])
            before = states[k - 1] if k else None
            same_class = k > 0 and fixes.fix_class[k] == fixes.fix_class[k - 1]
            if before in {NOMINAL, REPEATED_NOMINAL} and same_class and config.gps.has_memory:
                passed_s = min(fixes.t_s[k] - fixes.t_s[k - 1], 1.0)
                good, jumps = (
                    1.0 - passed_s * (low + bad_share),
                    passed_s * (1.0 - config.gps.memory.persistence),
                )
                prior[[LOWER, OUTLIER]] *= passed_s
                prior[[NOMINAL, REPEATED_NOMINAL]] = jumps * good, (1.0 - jumps) * good
            lower_lasts = before in {LOWER, REPEATED_LOWER} and has_lower[k]
            if lower_lasts or before in {OUTLIER, REPEATED_OUTLIER}:
                lasts = JUDGE.persistence ** min(fixes.t_s[k] - fixes.t_s[k - 1], 1.0)
                prior *= 1.0 - lasts
                prior[REPEATED_LOWER if lower_lasts else REPEATED_OUTLIER] = lasts
            weight *= prior[state]
            if not weight:
                break
            regions = [FIX if lower else FLOAT for lower in has_lower]
            if state in {NOMINAL, LOWER}:
                weight *= density(offset[k], *(regions[k] if state == NOMINAL else FLOAT))
            elif state == REPEATED_NOMINAL:
                weight *= walked(offset, k, fixes, config)
            elif state == OUTLIER:
                weight *= bad
            else:
                weight *= repeated(offset, k, fixes, regions, config)
        for k, state in enumerate(states):
            total[k, state] += weight
    return total / total.sum(axis=1, keepdims=True), np.log(total[0].sum())


@pytest.mark.slow
@pytest.mark.parametrize("error_model", ["memory", "independent"])
@pytest.mark.parametrize("seed", range(3))
def test_forward_and_backward_are_the_sum_over_all_sequences(seed, error_model):
    rng = np.random.default_rng(seed)
    has_lower = np.array([True, True, False, True])
    offset = rng.normal(0, [0.05, 0.05, 0.03], (4, 3))
    offset[1:3] += [2.0, 1.0, 0.5] if seed else [20.0, 1.0, 0.5]
    r, h = np.where(has_lower, FIX[0], FLOAT[0]), np.where(has_lower, FIX[1], FLOAT[1])
    lower = [np.where(has_lower, size, np.nan) for size in FLOAT]
    fixes = fixes_at(np.array([0.0, 0.1, 2.1, 2.5]), r, h, lower=lower)
    fixes = replace(fixes, fix_class=np.where(has_lower, 0, 1))
    config = CONFIG.model_copy(update={"gps": CONFIG.gps.model_copy(update={"error_model": error_model})})
    found, likelihood = state_probabilities(offset, fixes, config)
    expected, log_total = by_enumeration(offset, fixes, config)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert likelihood.sum() == pytest.approx(log_total, abs=1e-9)


def test_six_wrong_fixes_that_agree_count_as_one_error():
    t_s, one_off = np.arange(6.0), np.array([15.0, -9.0, 4.0])
    rng = np.random.default_rng(0)
    fixes = fixes_at(t_s, *FIX, lower=FLOAT)
    _, single = state_probabilities(one_off[None], fixes.where(t_s < 1.0), CONFIG)
    found, together = state_probabilities(one_off + rng.normal(0, 0.01, (6, 3)), fixes, CONFIG)
    apart = rng.permuted(np.tile(one_off, (6, 1)), axis=1) * rng.choice([-1, 1], (6, 3))
    scattered, six = state_probabilities(apart, fixes, CONFIG)
    assert together.sum() > single.sum() and six.sum() < 5 * single.sum()
    assert found[1:, REPEATED_OUTLIER].min() > 0.99 and found[0, OUTLIER] > 0.99
    assert scattered[:, NOMINAL].max() < 1e-6


@pytest.mark.parametrize("rate_hz", [1, 10, 100])
def test_good_fixes_are_good_however_many_a_second(rate_hz):
    t_s = np.arange(0.0, 15.0, 1.0 / rate_hz)
    walks_m = 0.01 * np.sin(0.5 * t_s[:, None] + np.arange(3.0))
    found, _ = state_probabilities(walks_m, fixes_at(t_s, *FIX, lower=FLOAT), CONFIG)
    assert found[:, [NOMINAL, REPEATED_NOMINAL]].sum(axis=1).min() > 0.999


def test_a_fix_without_a_class_below_is_never_down_classed():
    t_s = np.arange(2.0)
    lower = [np.array([size, np.nan]) for size in FLOAT]
    r, h = np.array([FIX[0], FLOAT[0]]), np.array([FIX[1], FLOAT[1]])
    found, _ = state_probabilities(np.tile([1.0, 0.0, 0.0], (2, 1)), fixes_at(t_s, r, h, lower=lower), CONFIG)
    assert (
        found[0, LOWER] > 0.9 and found[1, [LOWER, REPEATED_LOWER]].max() == 0.0 and found[1, NOMINAL] > 0.9
    )


def test_a_long_stretch_off_by_more_than_its_region_does_not_outvote_good_fixes():
    """Forty RTK-floats two regions off are one unlikely error under memory, forty without."""
    t_s, offset = np.arange(40.0), np.tile([5.0, 0.0, 0.0], (40, 1))
    independent = CONFIG.gps.model_copy(update={"error_model": "independent"})

    def log_likelihood(config, here):
        return state_probabilities(here, fixes_at(t_s, *FLOAT), config)[1].sum()

    lost = [
        log_likelihood(config, 0.0 * offset) - log_likelihood(config, offset)
        for config in (CONFIG, CONFIG.model_copy(update={"gps": independent}))
    ]
    assert lost[0] < 10.0
    assert lost[1] > 100.0


def test_a_jump_to_far_outside_the_region_is_an_outlier_under_memory():
    offset = np.zeros((9, 3))
    offset[4] = [30.0, 0.0, 0.0]
    found, _ = state_probabilities(offset, fixes_at(np.arange(9.0), *FLOAT), CONFIG)
    assert found[4, OUTLIER] > 0.99 and found[[0, 1, 2, 3, 5, 6, 7, 8], OUTLIER].max() < 0.01


def test_a_long_stretch_far_from_its_region_has_probabilities_too():
    """From fix to fix it changes little, as if one error of the class lasted; its first fix excludes that."""
    n = 300
    offset = np.random.default_rng(0).normal(0.0, 0.1, (n, 3))
    offset[50:] += [0.0, 34.0, 0.0]
    found, likelihood = state_probabilities(offset, fixes_at(0.5 * np.arange(n), *FLOAT), CONFIG, 0.2)
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-9)
    assert found[:50, [NOMINAL, REPEATED_NOMINAL]].sum(axis=1).min() > 0.99
    assert found[51:, REPEATED_OUTLIER].min() > 0.9 and np.isfinite(likelihood).all()


def test_rtk_fixes_are_good_although_they_differ_by_more_than_a_receivers_noise():
    """An antenna on a pole that sways by centimetres: all of them were taken for RTK-floats."""
    t_s = np.arange(0.0, 15.0, 0.1)
    sway_m = 0.02 * np.random.default_rng(0).normal(size=(len(t_s), 3))
    fixes = fixes_at(t_s, *FIX, lower=FLOAT)
    found, _ = state_probabilities(sway_m, replace(fixes, fix_class=np.zeros(len(t_s), dtype=int)), CONFIG)
    assert np.mean(found[:, [NOMINAL, REPEATED_NOMINAL]].sum(axis=1) > 0.9) > 0.97
