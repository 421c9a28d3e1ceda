"""Structure above the antenna hides sky, by solid angle, and a region grows by the stated rule."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_fixes import T_S, fixes_at, path, poses

from vgps.config import GpsConfig, QualityConfig, SkyConfig
from vgps.gps.sensors import Sensors
from vgps.gps.sky_view import hidden_factor, hidden_share, horizon_sin, under_sky
from vgps.solution import Trajectory

SKY = SkyConfig(
    enlarge=True, mask_deg=15.0, sectors=24, min_landmarks=3, min_distance_m=1.0, max_distance_m=60.0
)
QUALITY = QualityConfig(good_satellites=8)
HERE = np.array([[10.0, -5.0, 2.0]])


def ring(elevation_deg, distance_m=20.0, around_deg=(0.0, 360.0)):
    """Landmarks every degree, seen from HERE."""
    turn = np.radians(np.arange(*around_deg) + 0.5)
    up = np.full(len(turn), np.tan(np.radians(elevation_deg)))
    return HERE + distance_m * np.stack([np.cos(turn), np.sin(turn), up], axis=1)


def test_an_open_sky_hides_nothing():
    assert hidden_share(HERE, np.zeros((0, 3)), SKY) == [0.0]
    assert hidden_share(HERE, ring(14.9), SKY) == [0.0]  # below the mask
    assert hidden_share(HERE, ring(-30.0), SKY) == [0.0]
    assert hidden_share(np.zeros((0, 3)), ring(40.0), SKY).shape == (0,)


def test_a_wall_all_around_hides_its_zone_of_the_sky():
    expected = (0.5 - np.sin(np.radians(15.0))) / (1.0 - np.sin(np.radians(15.0)))  # up to 30 degrees
    assert hidden_share(HERE, ring(30.0), SKY)[0] == pytest.approx(expected)
    half = hidden_share(HERE, ring(30.0, around_deg=(90.0, 270.0)), SKY)[0]
    assert half == pytest.approx(expected / 2)


def test_the_horizon_has_the_azimuth_of_its_landmarks():
    horizon = horizon_sin(HERE[0], ring(30.0, around_deg=(90.0, 105.0)), SKY)  # north, 15 degrees a sector
    assert horizon[6] == pytest.approx(0.5) and np.count_nonzero(horizon) == 1


def test_single_landmarks_near_ones_and_far_ones_do_not_count():
    few = ring(60.0, around_deg=(0.0, 2.0))
    assert hidden_share(HERE, few, SKY) == [0.0]
    assert hidden_share(HERE, ring(60.0, 0.9), SKY) == [0.0]
    assert hidden_share(HERE, ring(60.0, 61.0), SKY) == [0.0]
    unknown = np.full((5, 3), np.nan)
    assert hidden_share(HERE, np.vstack([ring(30.0), unknown, few]), SKY)[0] == pytest.approx(
        hidden_share(HERE, ring(30.0), SKY)[0]
    )


def test_satellites_in_the_hidden_share_are_lost():
    factor = hidden_factor(np.array([0.0, 0.4, 0.4, 0.4]), np.array([14.0, 14.0, np.nan, 3.0]), QUALITY)
    # 10 to spare of 14, 4.4 of 8.4; 4 of 8, where nothing is said, less than one of 4.8; none at all
    np.testing.assert_allclose(factor, [1.0, np.sqrt(10 / 4.4), 2.0, 1.0])


@pytest.mark.slow
@given(
    share=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2).map(sorted),
    satellites=st.floats(0.0, 60.0) | st.just(float("nan")),
)
def test_regions_grow_with_the_hidden_share_and_never_shrink(share, satellites):
    less, more = hidden_factor(np.array(share), np.full(2, satellites), QUALITY)
    assert 1.0 <= less <= more


def test_only_regions_of_fixes_within_the_video_grow():
    t_s = np.array([-5.0, 5.0, 15.0])
    fixes = fixes_at(t_s, 2.0, 5.0, lower=(3.0, 7.0))
    walls = ring(30.0) - HERE + path(np.array([5.0]))
    trajectory, sensors = Trajectory(T_S, poses(path(T_S))), Sensors.fixed(np.zeros(3))
    satellites = np.full(3, 8.0)
    config = GpsConfig(sky=SKY.model_copy(update={"max_distance_m": 25.0}), quality=QUALITY)
    found = under_sky(fixes, trajectory, walls, sensors, satellites, config)
    share = hidden_share(path(np.array([5.0])), walls, SKY)
    factor = hidden_factor(share, satellites[:1], QUALITY)[0]
    assert factor > 1.1
    np.testing.assert_allclose(found.r_m, [2.0, 2.0 * factor, 2.0], rtol=1e-6)
    np.testing.assert_allclose(found.h_m, [5.0, 5.0 * factor, 5.0], rtol=1e-6)
    np.testing.assert_allclose(found.lower_r_m, [3.0, 3.0 * factor, 3.0], rtol=1e-6)
    np.testing.assert_array_equal(found.world_p_fix, fixes.world_p_fix)
    off = config.model_copy(update={"sky": config.sky.model_copy(update={"enlarge": False})})
    assert under_sky(fixes, trajectory, walls, sensors, satellites, off) is fixes
    late = replace(fixes, t_s=t_s + 0.5)
    again = under_sky(late, trajectory, walls, Sensors.fixed(np.zeros(3), 0.5), satellites, config)
    np.testing.assert_allclose(again.r_m, found.r_m)
