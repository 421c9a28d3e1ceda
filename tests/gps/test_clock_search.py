"""Clocks that are wrong by seconds: found where the path turns or brakes, and never where it does neither."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_fixes import fixes_at, trajectory

from vgps.config import SensorsConfig, StartConfig
from vgps.gps.clock_search import levelled, mirrored_share, search_time_offset, shows_no_time_offset
from vgps.solution import Trajectory

VIDEO_S = np.arange(0.0, 60.0, 0.1)
ANTENNA = np.array([0.3, -0.9, 0.1])
CONFIG = SensorsConfig()


def street(t_s):
    """Positions (N, 3) of a car that brakes, turns by 90 degrees, and drives on through a bend."""
    fine = np.arange(-90.0, 150.0, 0.02)
    speed = 9.0 - 6.0 * np.exp(-(((fine - 22.0) / 3.0) ** 2))
    heading = np.radians(90.0) / (1.0 + np.exp(-(fine - 22.0) / 0.7)) - 0.4 * np.sin(fine / 9.0)
    moved = 0.02 * np.cumsum(speed * np.exp(1j * heading))
    return np.stack([np.interp(t_s, fine, moved.real), np.interp(t_s, fine, moved.imag), 0 * t_s], axis=1)


def straight(t_s):
    return np.stack([7.0 * t_s, 2.0 * t_s, 0 * t_s], axis=1)


def circle(t_s):
    return np.stack([20.0 * np.cos(0.3 * t_s), 20.0 * np.sin(0.3 * t_s), 0 * t_s], axis=1)


def seen(place, scale=1.0, turned_deg=0.0):
    """The camera's path as a video without fixes gives it: at its own place, scale and heading."""
    turned = scale * np.exp(1j * np.radians(turned_deg))
    moved = (place[:, 0] + 1j * place[:, 1]) * turned
    return trajectory(np.stack([moved.real + 300.0, moved.imag, place[:, 2]], axis=1), VIDEO_S)


def stamped(place_of, late_s, noise_m=0.02, seed=0, t_s=np.arange(0.3, 59.0)):  # noqa: B008
    """Fixes whose stamps are later than their positions, by so much."""
    noise = np.random.default_rng(seed).normal(0.0, noise_m, (len(t_s), 3))
    fixes = replace(fixes_at(t_s, 2.4, 6.5), world_p_fix=place_of(t_s) + noise)
    return replace(fixes, t_s=t_s + late_s)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [-21.0, 0.0, 3.4])
def test_a_clock_is_found_whatever_the_scale_and_heading_of_the_video(late_s):
    path = seen(street(VIDEO_S), scale=0.3, turned_deg=140.0)
    found = search_time_offset(path, stamped(street, late_s), np.zeros(3), CONFIG)
    assert found == pytest.approx(late_s, abs=0.15)


@pytest.mark.slow
def test_the_search_is_about_the_configured_offset():
    config = SensorsConfig(time_offset_s=-3600.0)
    found = search_time_offset(seen(street(VIDEO_S)), stamped(street, -3605.0), ANTENNA, config)
    assert found == pytest.approx(-3605.0, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_wrong_fixes_may_hide_it_but_never_show_another(seed):
    fixes, rng = stamped(street, 6.0, noise_m=0.1, seed=seed), np.random.default_rng(100 + seed)
    fixes.world_p_fix[::6] += rng.normal(0.0, 40.0, (len(fixes.t_s[::6]), 3))
    found = search_time_offset(seen(street(VIDEO_S)), fixes, np.zeros(3), CONFIG)
    assert found is None or abs(found - 6.0) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("begins", [True, False])
def test_a_jump_of_the_fixes_near_an_end_shows_no_offset_that_leaves_it_out(begins):
    """A receiver that loses its ambiguities 3 s after a walk began, or has them back 3 s before its end."""
    video_s, t_s = np.arange(0.0, 30.0, 0.1), np.arange(0.3, 29.0)

    def walk(t_s):
        fine = np.arange(-70.0, 140.0, 0.02)
        moved = 0.02 * np.cumsum(np.exp(0.5j * np.sin(0.1 * fine)))  # bends gently
        return np.stack([np.interp(t_s, fine, part) for part in (moved.real, moved.imag, 0 * fine)], axis=1)

    fixes = stamped(walk, 0.0, noise_m=0.01, t_s=t_s)
    fixes.world_p_fix[t_s < 3.0 if begins else t_s > 26.0] += [1.0, -1.5, 0.0]
    found = search_time_offset(trajectory(walk(video_s), video_s), fixes, np.zeros(3), CONFIG)
    assert found is None or abs(found) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("float_r_m, shown", [(3.0, False), (0.07, True)])
def test_quiet_fixes_of_a_straight_do_not_win_over_the_right_noisy_ones(float_r_m, shown):
    """A clip of six seconds of a walk, 20 s in, where all but the first fixes are RTK-floats."""
    t_s, video_s = np.arange(0.3, 44.0), np.arange(0.0, 5.7, 0.1)

    def walk(t_s):
        return np.stack([1.4 * t_s, 0.02 * t_s, 0 * t_s], axis=1)

    floats = t_s > 5.5
    fixes = stamped(walk, -20.0, noise_m=0.002, t_s=t_s)
    fixes.world_p_fix[floats] += np.random.default_rng(5).normal(0.0, 0.3, (int(floats.sum()), 3))
    fixes = replace(fixes, r_m=np.where(floats, float_r_m, 0.07))
    found = search_time_offset(trajectory(walk(video_s + 20.0), video_s), fixes, np.zeros(3), CONFIG)
    assert (found is not None) == shown


@pytest.mark.slow
def test_fixes_that_are_not_used_do_not_count():
    fixes = stamped(street, 6.0)
    fixes.world_p_fix[::2] = 0.0
    fixes.used[::2] = False
    found = search_time_offset(seen(street(VIDEO_S)), fixes, np.zeros(3), CONFIG)
    assert found == pytest.approx(6.0, abs=0.25)


@pytest.mark.slow
def test_fixes_of_a_stop_agree_with_no_motion_at_all():
    """At offsets where only they are within the video, nothing is left of the fixes' displacements."""

    def stopping(t_s):
        return street(np.minimum(t_s, 24.0))

    found = search_time_offset(seen(stopping(VIDEO_S)), stamped(stopping, 4.0), np.zeros(3), CONFIG)
    assert found == pytest.approx(4.0, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize(("place_of", "seed"), [(straight, 0), (circle, 1)])
def test_a_motion_that_looks_the_same_at_all_times_shows_none(place_of, seed):
    path = seen(place_of(VIDEO_S))
    assert search_time_offset(path, stamped(place_of, 5.0, seed=seed), np.zeros(3), CONFIG) is None


@pytest.mark.parametrize(("place_of", "silent"), [(straight, True), (circle, True), (street, False)])
@pytest.mark.parametrize("late_s", [0.0, 5.0])
def test_a_motion_that_shows_no_time_offset_is_known_whatever_the_clock(place_of, silent, late_s):
    path, fixes = seen(place_of(VIDEO_S)), stamped(place_of, late_s)
    assert shows_no_time_offset(path, fixes, np.zeros(3), SensorsConfig(time_offset_s=5.0 - late_s)) == silent


def test_offsets_that_leave_too_few_fixes_within_the_video_show_nothing():
    fixes = stamped(circle, 0.0, t_s=np.arange(0.3, 9.0))  # 8 pairs, and fewer at most other offsets
    video = Trajectory(VIDEO_S[:90], seen(circle(VIDEO_S)).world_T_camera[:90])
    assert shows_no_time_offset(video, fixes, np.zeros(3), CONFIG)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_fixes_of_another_motion_show_none(seed):
    def another(t_s):
        steps = np.random.default_rng(100 + seed).normal(0.0, 1.5, (len(t_s), 3))
        return np.cumsum(steps, axis=0)

    path = seen(street(VIDEO_S))
    assert search_time_offset(path, stamped(another, 0.0, seed=seed), np.zeros(3), CONFIG) is None


@pytest.mark.parametrize("count", [0, 1, 5])
def test_a_few_fixes_show_none(count):
    fixes = stamped(street, 4.0).where(np.arange(20, 20 + count))
    assert search_time_offset(seen(street(VIDEO_S)), fixes, np.zeros(3), CONFIG) is None


@pytest.mark.slow
def test_leaps_of_the_fixes_do_not_hide_the_time_offset():
    """A clip of 14 s in a long log of RTK-floats that settle anew three times within it, by metres."""
    fixes = stamped(street, 7.0, noise_m=0.05)
    for since_s, leap in ((25.0, [2.0, -3.0, 0.0]), (29.0, [-4.0, 1.0, 0.0]), (33.0, [3.0, 3.0, 0.0])):
        fixes.world_p_fix[fixes.t_s > since_s] += leap
    clip_s = np.arange(14.0, 28.0, 0.1)
    found = search_time_offset(trajectory(street(clip_s), clip_s), fixes, np.zeros(3), CONFIG)
    assert found == pytest.approx(7.0, abs=0.35)


@pytest.mark.slow
def test_few_fixes_of_a_clip_with_an_outage_show_its_time_offset():
    """A log that begins and ends with the video: at other time offsets fewer than its nine are within it."""
    clip_s, t_s = np.arange(16.0, 27.0, 0.1), np.delete(np.arange(16.5, 27.0), [4, 5])
    fixes = stamped(street, 3.4, t_s=t_s)
    found = search_time_offset(trajectory(street(clip_s), clip_s), fixes, np.zeros(3), CONFIG)
    assert found == pytest.approx(3.4, abs=0.15)


@pytest.mark.parametrize("pitch_deg", [0.0, 40.0, 90.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_path_in_any_frame_is_laid_flat(pitch_deg, seed):
    """Cameras that look ahead and down as far as straight to the ground, in the frame of the first one."""
    place, pitch = street(VIDEO_S), np.radians(pitch_deg)
    poses = np.tile(np.eye(4), (len(place), 1, 1))
    down, ahead = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])
    axis_z = np.cos(pitch) * ahead + np.sin(pitch) * down
    axis_y = np.cos(pitch) * down - np.sin(pitch) * ahead
    poses[:, :3, :3] = np.stack([np.cross(axis_y, axis_z), axis_y, axis_z], axis=1)
    poses[:, :3, 3] = place
    turned = np.eye(4)
    turned[:3, :3] = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    flat = levelled(Trajectory(VIDEO_S, turned @ poses), StartConfig())
    assert np.ptp(flat.world_T_camera[:, 2, 3]) < 1e-6
    np.testing.assert_allclose(flat.world_T_camera[:, 2, :3], poses[:, 2, :3], atol=1e-6)  # not upside down
    # the street but for its heading, and clocks are found whatever that is
    steps = np.diff(place[:, :2] @ [1.0, 1j]), np.diff(flat.world_T_camera[:, :2, 3] @ [1.0, 1j])
    np.testing.assert_allclose(steps[1], steps[0] * (steps[1][0] / steps[0][0]), atol=1e-6)


def test_a_camera_upside_down_has_its_feet_above_it():
    poses = seen(street(VIDEO_S)).world_T_camera.copy()
    poses[:, :3, :3] = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    flat = levelled(Trajectory(VIDEO_S, poses), StartConfig(roll_deg=180.0))
    np.testing.assert_allclose(flat.world_T_camera[:, 2, :3], poses[:, 2, :3], atol=1e-6)


def test_a_path_of_two_places_is_laid_flat():
    flat = levelled(Trajectory(VIDEO_S[:2], seen(street(VIDEO_S)).world_T_camera[:2]), StartConfig())
    assert np.ptp(flat.world_T_camera[:, 2, 3]) < 1e-6


@pytest.mark.slow
def test_a_mirrored_picture_turns_the_other_way_than_the_fixes():
    fixes, mirror = stamped(street, -1.0, noise_m=0.5), np.array([1.0, -1.0, 1.0])
    right, mirrored = (
        seen(street(VIDEO_S) * axes, scale=0.3, turned_deg=140.0) for axes in (np.ones(3), mirror)
    )
    assert mirrored_share(right, fixes, np.zeros(3), CONFIG) is None
    assert mirrored_share(mirrored, fixes, np.zeros(3), CONFIG) < 0.1


@pytest.mark.parametrize("place_of", [straight, lambda t_s: 0 * street(t_s)])
def test_a_straight_and_a_stand_look_alike_in_a_mirror(place_of):
    fixes = stamped(place_of, 0.0, noise_m=0.5)
    assert mirrored_share(seen(place_of(VIDEO_S)), fixes, np.zeros(3), CONFIG) is None


def test_fixes_that_neither_explains_show_no_mirror():
    fixes = stamped(lambda t_s: np.random.default_rng(3).normal(0.0, 9.0, (len(t_s), 3)), 0.0)
    assert mirrored_share(seen(street(VIDEO_S)), fixes, np.zeros(3), CONFIG) is None
