from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ANTENNA, DrivingCamera

from vgps.config import Config
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.sensors import TimeOffset
from vgps.model import FixClass
from vgps.online.fusion.clock_profile import ProfiledClock
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.live_sensors import LiveSensors

CONFIG = Config()


def buffer(*kinds, antenna=ANTENNA, config=CONFIG):
    return FixBuffer(DrivingCamera(100).fixes(list(kinds), np.zeros((len(kinds), 3))), antenna, config)


def unknown(*kinds, config=CONFIG):
    """Sensors of a rig without a lever arm, once the fits have been asked to expect these fixes."""
    fixes = buffer(*kinds, antenna=np.zeros(3), config=config)
    sensors = LiveSensors(fixes, config.sensors, antenna_known=False)
    return sensors, sensors.expect(fixes)


def test_a_lever_arm_that_was_measured_is_held():
    fixes = buffer(FixClass.RTK_FIX)
    sensors = LiveSensors(fixes, CONFIG.sensors, antenna_known=True)
    assert not sensors.expect(fixes) and sensors.estimated_lever_arm is None
    np.testing.assert_array_equal(sensors.lever_arm.camera_p_antenna, ANTENNA)
    assert (sensors.lever_arm.sigma_m < 1e-3).all() and not sensors.unsure_of_antenna


def test_unless_the_settings_say_that_it_is_estimated():
    config = Config.model_validate({"sensors": {"estimate_antenna": True, "antenna_sigma_m": 0.3}})
    fixes = buffer(FixClass.SINGLE, config=config)
    sensors = LiveSensors(fixes, config.sensors, antenna_known=True)
    assert sensors.expect(fixes) and sensors.unsure_of_antenna
    np.testing.assert_array_equal(sensors.estimated_lever_arm.camera_p_antenna, ANTENNA)
    np.testing.assert_allclose(sensors.estimated_lever_arm.sigma_m, 0.3)


@pytest.mark.parametrize(
    ("kinds", "sigma_m"),
    [
        ([FixClass.SINGLE, FixClass.DGPS], 0.1),
        ([FixClass.SINGLE, FixClass.RTK_FLOAT], 1.0),
        ([FixClass.RTK_FIX], 1.0),
    ],
)
def test_the_class_of_the_fixes_says_whose_antenna_it_is(kinds, sigma_m):
    sensors, anew = unknown(*kinds)
    assert anew and sensors.unsure_of_antenna == (sigma_m == 1.0)
    np.testing.assert_allclose(sensors.estimated_lever_arm.sigma_m, sigma_m)


def test_fits_begin_anew_when_a_receiver_proves_to_have_its_own_antenna_and_not_when_it_loses_its_fixes():
    sensors, _ = unknown(FixClass.SINGLE)
    single, fixed = (
        buffer(FixClass.SINGLE, antenna=np.zeros(3)),
        buffer(FixClass.RTK_FIX, antenna=np.zeros(3)),
    )
    assert not sensors.expect(single)
    assert sensors.expect(fixed)
    assert not sensors.expect(single) and not sensors.expect(fixed)
    assert (sensors.lever_arm.sigma_m == 1.0).all()


def test_maps_are_placed_knowing_how_far_off_the_antenna_may_be():
    fixes = buffer(FixClass.RTK_FIX, antenna=np.zeros(3))
    sensors = LiveSensors(fixes, CONFIG.sensors, antenna_known=False)
    before = fixes.sensors
    sensors.expect(fixes)
    assert before.antenna_sigma_m == 0.0 and fixes.sensors.antenna_sigma_m == 1.0
    fixes.sensors = before  # stage C hands back those that it began with
    assert not sensors.expect(fixes) and fixes.sensors.antenna_sigma_m == 1.0


def test_zero_holds_a_lever_arm_that_nobody_gave():
    config = Config.model_validate({"sensors": {"unknown_antenna_sigma_m": 0}})
    sensors, anew = unknown(FixClass.RTK_FIX, config=config)
    assert not anew and sensors.estimated_lever_arm is None


class Fit:
    """What the sensors look at of a fit."""

    time_offset = TimeOffset(0.25, 0.01)
    lever_arm = LeverArm(np.array([0.1, -0.9, 0.4]), np.diag([0.5, 1.0, 0.1]) ** 2)


def test_what_a_map_shows_is_known_of_the_next_but_not_counted_twice_in_the_same():
    sensors, _ = unknown(FixClass.RTK_FIX)
    assert sensors.follow(Fit).time_offset_s == 0.25
    assert sensors.lever_arm is Fit.lever_arm and sensors.known_s == 0.0
    sensors.begin_anew()
    np.testing.assert_array_equal(sensors.lever_arm.camera_p_antenna, np.zeros(3))
    sensors.follow(Fit)
    sensors.begin_map()
    assert sensors.lever_arm is Fit.lever_arm and sensors.known_s == 0.25
    sensors.follow(Fit)
    sensors.begin_anew()
    assert sensors.lever_arm is Fit.lever_arm
    assert sensors.follow(Fit).time_offset_s == 0.5


def test_the_user_hears_once_that_the_lever_arm_of_an_antenna_of_its_own_is_missed():
    sensors, _ = unknown(FixClass.RTK_FIX)
    (sentence,) = sensors.news(TimeOffset(0.0, 0.01))
    assert "uncertain by 1 m" in sentence and "camera_p_antenna" in sentence
    assert sensors.news(TimeOffset(0.0, 0.01)) == ()
    own, _ = unknown(FixClass.SINGLE)
    assert own.news(TimeOffset(0.0, 0.01)) == ()


def test_the_user_hears_of_a_clock_whose_change_counts():
    sensors, _ = unknown(FixClass.SINGLE)
    assert sensors.news(TimeOffset(0.04, 0.05)) == ()
    (sentence,) = sensors.news(TimeOffset(0.37, 0.05))
    assert "0.37 s older" in sentence and "0.05 s" in sentence
    assert sensors.news(TimeOffset(0.35, 0.05)) == ()


def test_and_nothing_of_one_that_was_measured_however_the_fits_pull_at_it():
    fixes = buffer(FixClass.RTK_FIX)
    sensors = LiveSensors(fixes, CONFIG.sensors, antenna_known=True)
    sensors.expect(fixes)
    sensors.lever_arm = LeverArm.within(ANTENNA + np.array([0.0, 0.0, 1e-3]))  # by ten standard deviations
    assert sensors.news(TimeOffset(0.0, 0.01)) == ()


def test_and_of_an_antenna_that_is_surely_elsewhere():
    sensors, _ = unknown(FixClass.SINGLE)
    same = TimeOffset(0.0, 0.01)
    sensors.lever_arm = replace(Fit.lever_arm, camera_p_antenna=np.array([0.1, -0.9, 0.2]))
    assert sensors.news(same) == ()
    sensors.lever_arm = Fit.lever_arm  # by four standard deviations
    (sentence,) = sensors.news(same)
    assert "0.10 +- 0.50 m right, -0.90 +- 1.00 m down, 0.40 +- 0.10 m forward" in sentence
    assert sensors.news(same) == ()


def test_a_clock_that_was_found_is_believed_as_far_as_it_was_shown():
    config = Config()
    sensors, _ = unknown(FixClass.RTK_FIX)
    assert sensors.settings(config) is config
    assert not sensors.finds_another_clock(ProfiledClock(TimeOffset(0.3, 0.1), away_s=0.3))
    assert sensors.clock_away_s == 0.3 and sensors.settings(config) is config
    assert sensors.finds_another_clock(ProfiledClock(TimeOffset(0.28, 0.08), away_s=0.28))
    assert sensors.known_s == 0.28 and sensors.clock_away_s == 0.0
    used = sensors.settings(config).sensors
    assert used.estimate_time_offset == "yes" and used.time_offset_sigma_s == 0.08
    sensors.follow(Fit)
    sensors.begin_map()
    assert sensors.settings(config).sensors.time_offset_sigma_s == 0.01


def test_a_clock_that_is_held_stays_held():
    held = Config.model_validate({"sensors": {"estimate_time_offset": "no", "time_offset_s": 0.2}})
    sensors, _ = unknown(FixClass.RTK_FIX, config=held)
    sensors.known_s = 0.3
    assert sensors.settings(held) is held
