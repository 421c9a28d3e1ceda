"""Fixes share offsets that last, walk, start anew and are bounded by the regions of their classes."""

import gtsam
import numpy as np
import pytest
from scipy.stats import multivariate_t
from synthetic_fixes import fixes_of_size, trajectory

from vgps.config import GpsConfig
from vgps.config.gps import OffsetErrors
from vgps.gps.fixes import CLASSES
from vgps.gps.learned_errors import LearnedErrors, with_errors
from vgps.gps.offset_errors import student
from vgps.gps.offset_regions import with_mean_offset_regions, with_offset_regions
from vgps.gps.offsets import chain_offsets, gps_term, offset_key
from vgps.gps.sensors import Sensors
from vgps.model import FixClass

CONFIG = GpsConfig()
FIX, FLOAT = (CLASSES.index(name) for name in (FixClass.RTK_FIX, FixClass.RTK_FLOAT))
STANDING = trajectory(np.zeros((201, 3)), 0.1 * np.arange(201))


def fixes(t_s, fix_class=FLOAT, sigma_m=np.nan, error=0.0):
    t_s, n = np.asarray(t_s, dtype=float), len(t_s)
    regions = [CONFIG.regions[CLASSES[k]] for k in np.broadcast_to(fix_class, n)]
    return fixes_of_size(
        t_s,
        np.zeros((n, 3)) + error,
        np.array([region.r_m for region in regions]),
        np.array([region.h_m for region in regions]),
        correlation_s=np.array([region.correlation_s for region in regions]),
        fix_class=np.array(np.broadcast_to(fix_class, n)),
        sigma_m=np.repeat(np.broadcast_to(np.asarray(sigma_m, dtype=float), n)[:, None], 3, axis=1),
    )


def chain(found, config=CONFIG):
    return chain_offsets(found, found.used, config)


def term(found, config=CONFIG):
    return gps_term(found, STANDING, Sensors.fixed(np.zeros(3)), config)


def test_each_fix_has_an_offset_where_fixes_are_sparse():
    found = chain(fixes([0.0, 1.0, 2.0]))
    assert found.offset.tolist() == [0, 1, 2] and found.starts.tolist() == [True, False, False]


def test_fixes_of_one_interval_share_an_offset():
    found = chain(fixes(0.1 * np.arange(7)))
    assert found.offset.tolist() == [0, 0, 0, 1, 1, 1, 2] and found.first.tolist() == [0, 3, 6]


def test_an_offset_starts_anew_with_the_class_after_a_gap_and_where_the_stated_sigma_jumps():
    by_class = chain(fixes([0, 1, 2, 3], fix_class=[FIX, FIX, FLOAT, FLOAT]))
    assert by_class.starts.tolist() == [True, False, True, False]
    after_gap = chain(fixes([0, 1, 13, 14]))
    assert after_gap.starts.tolist() == [True, False, True, False]
    by_sigma = chain(fixes([0.0, 0.1, 0.2, 0.3], sigma_m=[0.05, 0.06, 2.0, 2.1]))
    assert by_sigma.offset.tolist() == [0, 0, 1, 1] and by_sigma.starts.tolist() == [True, True]


def test_fixes_that_do_not_contribute_have_no_offset():
    found = fixes([0, 1, 2])
    found.used[1] = False
    assert chain(found).rows.tolist() == [0, 2]
    assert term(found).noise.size() == 2 + 1  # noise of two fixes, and a step


def test_a_stretch_counts_once_per_correlation_time():
    assert term(fixes(np.arange(5.0))).weight.sum() == pytest.approx(1.0)
    long = fixes(np.arange(0.0, 20.0, 0.5), fix_class=FIX)
    assert term(long).weight.sum() == pytest.approx(19.5 / 10.0)
    two = fixes([0, 1, 2, 3], fix_class=[FIX, FIX, FLOAT, FLOAT])
    np.testing.assert_allclose(term(two).weight, 0.5)


def test_an_rtk_fix_is_bounded_as_the_mean_receiver_errs():
    found, given, values = term(fixes([1.0], FIX)), fixes([1.0], FIX), gtsam.Values()
    mean = with_mean_offset_regions(given, CONFIG)
    values.insert(offset_key(0), np.array([mean.r_m[0] / 2.4477, 0.0, 0.0]))  # one sigma of a region of 95 %
    assert found.bounds.at(0).error(values) == pytest.approx(0.5, rel=1e-4)
    np.testing.assert_allclose(found.bounded.r_m, mean.r_m)
    np.testing.assert_allclose(found.bounded.h_m, mean.h_m)


def test_an_rtk_float_is_bounded_as_receivers_of_all_sizes_err():
    """Small offsets cost more than those of the mean receiver, large ones less."""

    def cost(of_class, size_m):
        values = gtsam.Values()
        values.insert(offset_key(0), np.array([size_m, 0.0, 0.0]))
        return term(fixes([1.0], of_class)).bounds.at(0).error(values)

    mean = with_mean_offset_regions(fixes([1.0]), CONFIG).r_m[0] / 2.4477
    assert cost(FLOAT, 0.2 * mean) > 4 * 0.5 * 0.2**2
    assert cost(FLOAT, 10.0 * mean) < 0.5 * 0.5 * 10.0**2
    assert cost(FIX, 0.1) == pytest.approx(100.0 * cost(FIX, 0.01))  # a wrong one is another state


def test_a_loose_bound_costs_one_sigma_at_the_wall_of_the_median_receiver():
    given, values = fixes([1.0]), gtsam.Values()
    found = gps_term(given, STANDING, Sensors.fixed(np.zeros(3)), CONFIG, loose=True)
    values.insert(offset_key(0), np.array([with_offset_regions(given, CONFIG).r_m[0], 0.0, 0.0]))
    assert found.bounds.at(0).error(values) == pytest.approx(0.5)


def test_the_loss_is_the_density_of_students_t_in_space():
    errors = OffsetErrors(tail=2.5, vertical=3.0)
    density = multivariate_t(shape=np.diag([0.04, 0.04, 0.36]), df=2.5)
    at = np.array([[0.1, -0.3, 0.2], [0.0, 2.0, 5.0], [0.01, 0.0, -0.02]])
    expected = density.logpdf(np.zeros(3)) - density.logpdf(at)
    np.testing.assert_allclose(student(errors, 0.2).cost(at), expected, rtol=1e-9)


@pytest.mark.parametrize(("fix_class", "longer"), [(FIX, 2.0), (FLOAT, 4.0 ** (1 / 1.1))])
def test_steps_over_four_seconds_are_longer_by_the_law_of_their_tail(fix_class, longer):
    """The root of four with a finite variance, nearly four for steps with a tail near Cauchy's."""

    def cost_of_a_step(seconds, length):
        graph, values = term(fixes([1.0, 1.0 + seconds], fix_class)).noise, gtsam.Values()
        values.insert(offset_key(0), np.zeros(3))
        values.insert(offset_key(1), np.array([length, 0.0, 0.0]))
        return graph.at(2).error(values)

    assert cost_of_a_step(1.0, 0.3) == pytest.approx(cost_of_a_step(4.0, longer * 0.3))


def test_offsets_begin_at_the_error_of_their_fixes_as_the_path_tells():
    found = term(fixes(0.1 * np.arange(6), error=np.array([1.0, -2.0, 0.5])))
    np.testing.assert_allclose(found.offsets, [[1.0, -2.0, 0.5]] * 2)
    assert found.offset_frames.tolist() == [0, 3]


@pytest.mark.parametrize("model", ["gaussian", "gaussian-receiver", "cauchy", "none"])
def test_the_baselines_have_no_offsets(model):
    found = term(fixes([0, 1, 2]), CONFIG.model_copy(update={"model": model}))
    assert len(found.offsets) == 0 and found.noise.size() == 0


def test_without_memory_each_fix_is_bounded_by_itself():
    found = term(fixes([0, 1, 2]), CONFIG.model_copy(update={"error_model": "independent"}))
    assert found.bounds.size() == 3 and len(found.offsets) == 0
    np.testing.assert_allclose(found.bounded.r_m, 2.4)


def test_the_walk_within_the_interval_of_an_offset_is_noise_that_its_fixes_share():
    noise = term(fixes([0.0, 0.1, 0.2])).noise  # one offset; the middle one of its fixes lies at its time
    errors = CONFIG.offset_errors(FixClass.RTK_FLOAT)
    apart = float(np.hypot(errors.noise_m, np.sqrt(3.0) * errors.walk_m * 0.1 ** (1 / errors.tail)))
    for k, scale_m in enumerate([apart, errors.noise_m, apart]):
        found, expected = noise.at(k).noiseModel(), student(errors, scale_m).noise_model()
        assert isinstance(found, gtsam.noiseModel.Robust)  # Student's t as Cauchy's loss
        np.testing.assert_allclose(found.noise().sigmas(), expected.noise().sigmas())


def test_steps_lead_as_far_as_a_rate_that_lasts():
    errors = CONFIG.offset_errors(FixClass.RTK_FLOAT)
    # n steps of it lead n walks far, n being rate_lasts_s
    scale_m = errors.walk_m * np.sqrt(errors.rate_lasts_s)
    step = term(fixes([0, 1])).noise.at(2).noiseModel().noise().sigmas()
    np.testing.assert_allclose(step, student(errors, scale_m).noise_model().noise().sigmas())


def test_errors_drawn_for_sigmas_are_those_of_the_mean_receiver_until_the_log_shows_its_own():
    two = fixes([0, 1], fix_class=FIX)
    noise, step = np.exp(0.7**2 / 2), np.exp(0.6**2 / 2)  # spreads between receivers of an RTK-fix
    np.testing.assert_allclose(term(two).noise_ratio, [noise, noise, step])
    learned = with_errors(CONFIG, {FixClass.RTK_FIX: LearnedErrors(0.01, 0.02, 1.0)})
    np.testing.assert_allclose(term(two, learned).noise_ratio, 1.0)
    single = fixes([0, 1], fix_class=CLASSES.index(FixClass.SINGLE))
    lasting = np.sqrt(np.exp(1.1**2 / 2))  # the rate of its walk differs between receivers, too
    np.testing.assert_allclose(term(single).noise_ratio[-1], np.exp(1.1**2 / 2) * lasting)
