from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from vgps.simulate import SCENES, Motion, build_motion
from vgps.simulate.motion import center_line


def constant(east=0.0, north=0.0, up=0.0, yaw=0.0, pitch=0.0, roll=0.0) -> Motion:
    values = np.tile([east, north, up, yaw, pitch, roll], (5, 1)).astype(float)
    return Motion(CubicSpline(np.linspace(-2.0, 2.0, 5), values))


def test_axes_by_hand() -> None:
    east = constant(1.0, 2.0, 3.0).poses(np.zeros(1))[0]
    np.testing.assert_allclose(east[:3, 2], [1, 0, 0], atol=1e-12)  # forward is east
    np.testing.assert_allclose(east[:3, 0], [0, -1, 0], atol=1e-12)  # right is south
    np.testing.assert_allclose(east[:3, 1], [0, 0, -1], atol=1e-12)  # down is down
    np.testing.assert_allclose(east[:3, 3], [1, 2, 3])
    north = constant(yaw=np.pi / 2).poses(np.zeros(1))[0]
    np.testing.assert_allclose(north[:3, 2], [0, 1, 0], atol=1e-12)
    lifted = constant(pitch=np.deg2rad(30)).poses(np.zeros(1))[0]
    np.testing.assert_allclose(lifted[:3, 2], [np.sqrt(0.75), 0, 0.5], atol=1e-12)


@pytest.mark.slow
@given(st.lists(st.floats(-2.5, 2.5), min_size=15, max_size=15))
def test_rates_are_the_derivative_of_the_rotation(angles: list[float]) -> None:
    values = np.concatenate([np.zeros((5, 3)), np.reshape(angles, (5, 3))], axis=1)
    motion = Motion(CubicSpline(np.arange(5.0), values))
    t, h = np.array([0.7, 2.2]), 1e-5
    before, after = (Rotation.from_matrix(motion.poses(t + d)[:, :3, :3]) for d in (-h, h))
    np.testing.assert_allclose(motion.rates(t), (before.inv() * after).as_rotvec() / (2 * h), atol=1e-6)


@pytest.mark.parametrize(
    ("name", "least_m", "most_m"), [("walk", 66, 74), ("drive", 300, 500), ("demo", 14, 17)]
)
def test_scenes_have_their_length(name: str, least_m: float, most_m: float) -> None:
    config = SCENES[name]
    motion = build_motion(replace(config, bob_m=0.0), np.random.default_rng(0))
    path = motion.poses(np.arange(0.0, config.duration_s, 0.02))[:, :3, 3]
    assert least_m < np.linalg.norm(np.diff(path, axis=0), axis=1).sum() < most_m


def test_walk_is_the_experiments() -> None:
    config = SCENES["walk"]
    assert (config.frames, config.fps, config.width, config.height) == (1110, 15, 720, 480)


def test_a_hand_shakes_as_the_gyro_of_a_gopro_has_measured() -> None:
    config = replace(SCENES["walk"], speed=((0.0, 1.0), (60.0, 1.0)))
    t = np.arange(0.0, 60.0, 0.005)
    steady, shaken = (
        build_motion(replace(config, hand_shake=amount), np.random.default_rng(1)).rates(t)
        for amount in (0.0, 1.0)
    )
    frequency, power = welch(np.degrees(shaken - steady), 200.0, nperseg=2048, axis=0)
    rms = [
        np.sqrt(power[(frequency >= low) & (frequency < high)].mean(axis=1).sum() * frequency[1])
        for low, high in ((2, 4), (4, 8), (8, 16))
    ]
    np.testing.assert_allclose(rms, [2.5, 2.9, 2.3], rtol=0.25)  # deg/s, mean of gopro_walk's axes


def test_walker_bobs_at_each_step() -> None:
    config = replace(SCENES["walk"], speed=((0.0, 1.0), (20.0, 1.0)))
    t = np.arange(0.0, 20.0, 0.02)
    up = build_motion(config, np.random.default_rng(1)).poses(t)[:, 2, 3]
    spectrum = np.abs(np.fft.rfft(up - up.mean()))
    assert np.fft.rfftfreq(len(t), 0.02)[spectrum.argmax()] == pytest.approx(1.8, abs=0.05)
    assert np.ptp(up) == pytest.approx(2 * config.bob_m, rel=0.02)


def test_drive_stands_still_at_its_stop() -> None:
    motion = build_motion(SCENES["drive"], np.random.default_rng(0))
    standing = motion.poses(np.linspace(33.5, 38.5, 20))
    np.testing.assert_allclose(standing, np.broadcast_to(standing[0], standing.shape), atol=1e-6)
    assert np.linalg.norm(motion.poses(np.array([31.0]))[0, :3, 3] - standing[0, :3, 3]) > 1.0


@pytest.mark.parametrize("rate", [0.0, 40.0, 300.0])
def test_spin_reaches_its_peak_rate(rate: float) -> None:
    config = replace(SCENES["spin"], spin_deg_s=rate, bends=(), sway_deg=0.0, look_deg=0.0)
    motion = build_motion(config, np.random.default_rng(0))
    rates = np.rad2deg(np.linalg.norm(motion.rates(np.arange(0.0, config.duration_s, 0.01)), axis=1))
    assert rates.max() == pytest.approx(rate, rel=0.01, abs=1e-6)
    assert rates[:300].max() < 1.0  # a quarter of the 15 s passes before it begins


def test_center_line_follows_the_path_and_goes_on_straight() -> None:
    config = replace(SCENES["demo"], bob_m=0.0)
    line = center_line(config, 20.0, 30.0)
    np.testing.assert_allclose(np.hypot(*np.diff(line[:, 1:3], axis=0).T), 1.0, atol=1e-2)  # chords of bends
    path = build_motion(config, np.random.default_rng(0)).poses(np.arange(0, 13.0, 0.01))[:, :2, 3]
    inside = (line[:, 0] > 0) & (line[:, 0] < 15)
    apart = np.linalg.norm(line[inside, None, 1:3] - path, axis=-1).min(axis=1)
    assert apart.max() < 0.02
    np.testing.assert_allclose(line[:20, 1], line[:20, 0], atol=1e-9)  # it comes from the west
    assert np.ptp(line[-30:, 3]) == 0.0


def test_a_tilted_camera_stays_tilted_and_keeps_its_path() -> None:
    config = replace(SCENES["walk"], look_deg=0.0, sway_deg=0.0, bob_m=0.0)
    t = np.arange(0.0, 5.0, 0.5)
    level, askew = (
        build_motion(replace(config, roll_deg=roll), np.random.default_rng(0)).poses(t)
        for roll in (0.0, 10.0)
    )
    np.testing.assert_allclose(askew[:, :3, 2:], level[:, :3, 2:], atol=1e-12)  # forward, and where it is
    np.testing.assert_allclose(level[:, 2, 0], 0.0, atol=1e-12)
    # clockwise, seen from behind: its right side hangs down, but for the walk's mean tilt of 3 degrees
    np.testing.assert_allclose(askew[:, 2, 0], -np.sin(np.radians(10.0)) * np.cos(np.radians(3.0)), atol=1e-9)
