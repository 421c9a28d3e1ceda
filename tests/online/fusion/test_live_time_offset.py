import numpy as np
import pytest

from vgps.config import SensorsConfig
from vgps.gps.sensors import TimeOffset
from vgps.online.fusion.live_time_offset import (
    LiveTimeOffset,
    any_time_offset,
    believed_time_offset,
    with_time_offset_sigma,
)

CONFIG = SensorsConfig()


def found(time_offset_s, sigma_s):
    """What a fit finds of fixes that prefer a time offset by themselves."""
    prior = any_time_offset(CONFIG)
    information = sigma_s**-2 + prior.sigma_s**-2
    return TimeOffset(time_offset_s * sigma_s**-2 / information, information**-0.5)


def test_before_the_motion_shows_it_both_hypotheses_stand():
    believed = believed_time_offset(any_time_offset(CONFIG), CONFIG)
    assert believed.time_offset_s == pytest.approx(0.0, abs=1e-9)
    assert believed.sigma_s == pytest.approx(np.sqrt(0.5) * 0.5, rel=1e-3)
    assert believed.reach_s == believed.sigma_s


@pytest.mark.parametrize(
    ("preferred_s", "sigma_s", "least_s", "most_s"),
    [(0.4, 0.01, 0.39, 0.41), (-0.3, 0.02, -0.31, -0.28), (0.03, 0.01, 0.0, 0.0), (0.1, 0.04, 0.0, 0.0)],
)
def test_what_may_be_chance_moves_nothing(preferred_s, sigma_s, least_s, most_s):
    believed = believed_time_offset(found(preferred_s, sigma_s), CONFIG)
    # whatever is decided, the other hypothesis is within its sigmas
    assert least_s <= believed.time_offset_s <= most_s
    assert abs(believed.time_offset_s - preferred_s) < 3.0 * max(believed.sigma_s, 0.02)


@pytest.mark.parametrize(("sigma_s", "reach_s"), [(0.1, 0.25), (0.05, 0.145), (0.01, 0.036)])
def test_velocities_are_means_over_half_a_step_until_more_is_known_than_that_clocks_may_agree(
    sigma_s, reach_s
):
    """Three standard deviations and what clocks agree to, under the prior, where agreement is likelier."""
    believed = believed_time_offset(found(0.0, sigma_s), CONFIG)
    assert believed.sigma_s < believed.reach_s == pytest.approx(reach_s, abs=0.001)


def test_settings_decide_whether_it_is_found():
    chance = found(0.03, 0.01)
    no, yes = (CONFIG.model_copy(update={"estimate_time_offset": choice}) for choice in ("no", "yes"))
    assert believed_time_offset(chance, no) == LiveTimeOffset(0.0, 0.0, 0.0)
    assert believed_time_offset(chance, yes).time_offset_s == pytest.approx(0.03, abs=0.001)


def test_the_covariance_is_that_of_another_prior():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 4))
    information = A @ A.T + np.eye(4)
    weaker = information.copy()
    weaker[2, 2] -= 0.5
    expected = np.linalg.inv(weaker)
    changed = with_time_offset_sigma(np.linalg.inv(information), 2, float(np.sqrt(expected[2, 2])))
    np.testing.assert_allclose(changed, expected, rtol=1e-9)
