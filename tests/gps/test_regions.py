"""Regions grow where a log says that a fix is worse than its class, by the stated rule, and never shrink."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from solutions import make_gps_log

from vgps.config import GpsConfig, QualityConfig
from vgps.gps.fixes import fixes_in_world
from vgps.gps.regions import enlarged
from vgps.model import FixClass

NAN = float("nan")
RULE = QualityConfig(good_hdop=2.0, good_satellites=8, fresh_s=10.0, age_rate_m_s=0.002)


def log_of(
    hdop=NAN,
    satellites=NAN,
    age_s=NAN,
    sigma_m=(NAN, NAN, NAN),
    logging_sigma_m=(0.0, 0.0, 0.0),
    fix_class=FixClass.RTK_FLOAT,
):
    """One fix."""

    def one(value):
        return np.array([value], dtype=float)

    return make_gps_log(
        one(0.0),
        (fix_class,),
        sigma_m=np.array([sigma_m], dtype=float),
        logging_sigma_m=np.array([logging_sigma_m], dtype=float),
        hdop=one(hdop),
        satellites=one(satellites),
        correction_age_s=one(age_s),
    )


def region(r_m=2.0, h_m=5.0, rule=RULE, **said):
    wider, higher = enlarged(np.array([r_m]), np.array([h_m]), log_of(**said), rule)
    return float(wider[0]), float(higher[0])


def test_without_quality_data_the_region_is_that_of_the_class():
    assert region() == (2.0, 5.0)


def test_dilution_above_that_of_a_survey_scales_the_region():
    assert region(hdop=1.2) == (2.0, 5.0)
    assert region(hdop=5.0) == pytest.approx((5.0, 12.5))


def test_few_satellites_count_only_where_the_dilution_is_unknown():
    # two are left over instead of four
    assert region(satellites=6) == pytest.approx((2.0 * np.sqrt(2), 5.0 * np.sqrt(2)))
    assert region(satellites=6, hdop=1.0) == (2.0, 5.0)
    assert region(satellites=3) == pytest.approx((4.0, 10.0))


def test_old_corrections_enlarge_the_region():
    assert region(age_s=10.0) == (2.0, 5.0)
    assert region(age_s=60.0) == pytest.approx((2.1, 5.1))


def test_large_reported_sigmas_enlarge_the_region_and_small_ones_do_not_reduce_it():
    wide, high = region(sigma_m=(3.0, 4.0, 6.0))
    assert wide == pytest.approx(2.448 * 5.0 / np.sqrt(2), rel=1e-3) and high == pytest.approx(11.76)
    assert region(sigma_m=(0.01, 0.01, 0.01)) == (2.0, 5.0)


def test_the_errors_of_the_last_digits_enlarge_every_region():
    wide, high = region(logging_sigma_m=(0.3, 0.5, 2.0), sigma_m=(0.01, 0.01, 0.01))
    assert wide == pytest.approx(np.hypot(2.0, 2.448 * np.sqrt((0.3**2 + 0.5**2) / 2)), rel=1e-3)
    assert high == pytest.approx(np.hypot(5.0, 1.96 * 2.0))


def test_the_enlargement_can_be_disabled():
    off = RULE.model_copy(update={"enlarge": False})
    assert region(rule=off, hdop=9.0, age_s=500.0, sigma_m=(9.0, 9.0, 9.0)) == (2.0, 5.0)


def test_a_class_without_a_region_gets_none():
    log = log_of(hdop=9.0, age_s=100.0, sigma_m=(1.0, 1.0, 1.0), fix_class=FixClass.UNKNOWN)
    fixes = fixes_in_world(log, np.zeros((1, 3)), GpsConfig())
    assert not fixes.used.any() and np.isnan(fixes.r_m).all()


@pytest.mark.slow
@given(
    hdop=st.floats(0.1, 100) | st.just(NAN),
    satellites=st.integers(0, 60) | st.just(NAN),
    age_s=st.floats(0, 1e4) | st.just(NAN),
    sigma_m=st.tuples(*[st.floats(0, 1e3) | st.just(NAN)] * 3),
)
def test_regions_never_shrink_and_stay_finite(hdop, satellites, age_s, sigma_m):
    wide, high = region(hdop=hdop, satellites=satellites, age_s=age_s, sigma_m=sigma_m)
    assert np.isfinite([wide, high]).all() and wide >= 2.0 and high >= 5.0
