import io
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from pynmeagps import NMEAReader
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from vgps.geodesy import to_enu
from vgps.model import FixClass, GeodeticPoint
from vgps.simulate import SCENES, FixErrors, GpsConfig, GyroConfig, Motion, SceneConfig, build_motion
from vgps.simulate.sensor_config import FIX_ERRORS
from vgps.simulate.sensors import gauss_markov, gyro_R_camera, nmea, simulate_fixes, simulate_gyro

WALK = SCENES["walk"]


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def sentences(config: SceneConfig, seed: int = 0):
    fixes = simulate_fixes(build_motion(config, rng()), config, rng(seed))
    parsed = [message for _, message in NMEAReader(io.BytesIO(nmea(fixes, config)), quitonerror=2)]
    return fixes, {kind: [m for m in parsed if m.msgID == kind] for kind in ("GGA", "GST", "ZDA")}


def test_antenna_goes_through_the_lever_arm() -> None:
    # a camera at (10, 20, 30) that looks north: right is east, down is down, forward is north
    values = np.tile([10.0, 20.0, 30.0, np.pi / 2, 0.0, 0.0], (4, 1))
    motion = Motion(CubicSpline(np.array([-1.0, 50.0, 100.0, 150.0]), values))
    config = replace(WALK, camera_p_antenna=(0.1, -0.5, 0.3))
    fixes = simulate_fixes(motion, config, rng())
    np.testing.assert_allclose(
        fixes.world_p_antenna, np.tile([10.1, 20.3, 30.5], (len(fixes.t_s), 1)), atol=1e-9
    )


def test_fixes_come_at_their_own_time() -> None:
    fixes, _ = sentences(WALK)
    np.testing.assert_allclose(fixes.t_s, 0.03 + np.arange(74.0), atol=1e-9)
    phase = fixes.t_s * WALK.fps
    assert np.abs(phase - np.round(phase)).min() > 0.1


@pytest.mark.slow
def test_rtk_fix_at_both_ends_and_float_between() -> None:
    fixes, _ = sentences(WALK)
    fixed = [c is FixClass.RTK_FIX for c in fixes.fix_class]
    assert fixed[:15] == [True] * 15 and fixed[-14:] == [True] * 14 and not any(fixed[16:-16])
    everywhere, _ = sentences(replace(WALK, gps=GpsConfig(fix_share=0.5)))
    assert set(everywhere.fix_class) == {FixClass.RTK_FIX}
    assert np.abs(everywhere.error_m).max() < 0.1


def test_nmea_gives_back_the_antenna_and_the_logged_errors() -> None:
    config = replace(WALK, world_origin=GeodeticPoint(-34.7, -58.4, 25.0))
    fixes, read = sentences(config)
    place = np.array([[m.lat, m.lon, m.alt + m.sep] for m in read["GGA"]])
    measured = to_enu(config.world_origin, *place.T)
    np.testing.assert_allclose(measured - fixes.world_p_antenna, fixes.error_m, atol=3e-4)
    quality = {FixClass.RTK_FIX: 4, FixClass.RTK_FLOAT: 5}
    assert [m.quality for m in read["GGA"]] == [quality[c] for c in fixes.fix_class]
    assert len(read["GST"]) == len(read["ZDA"]) == len(fixes.t_s)
    claimed = [(m.stdLong, m.stdLat, m.stdAlt) for m in read["GST"]]
    assert claimed == [FIX_ERRORS[c].reported_m for c in fixes.fix_class]


def test_fixes_after_midnight_are_of_the_next_day() -> None:
    config = replace(SCENES["demo"], start_utc=datetime(2024, 2, 28, 23, 59, 55, tzinfo=UTC))
    fixes, read = sentences(config)
    days = [(m.year, m.month, m.day) for m in read["ZDA"]]
    assert days[0] == (2024, 2, 28) and days[-1] == (2024, 2, 29)
    for t, gga, zda in zip(fixes.t_s, read["GGA"], read["ZDA"], strict=True):
        at = datetime.combine(datetime(zda.year, zda.month, zda.day), gga.time, UTC)
        assert (at - config.start_utc).total_seconds() == pytest.approx(t, abs=1e-6)


def test_outliers_are_far_off_and_as_many_as_asked() -> None:
    fixes, _ = sentences(replace(WALK, gps=GpsConfig(fix_share=0.5, outliers=0.2, outlier_m=(8.0, 40.0))))
    assert fixes.outlier.sum() == round(0.2 * len(fixes.t_s))
    horizontal = np.hypot(*fixes.error_m[:, :2].T)
    assert horizontal[fixes.outlier].min() > 7.9 and horizontal[fixes.outlier].max() < 40.1
    assert horizontal[~fixes.outlier].max() < 0.1


@pytest.mark.slow
def test_gauss_markov_has_its_sigma_and_its_memory() -> None:
    error = gauss_markov(200_000, 1.0, FixErrors(sigma_h_m=0.75, sigma_v_m=2.2, correlation_s=25.0), rng())
    np.testing.assert_allclose(error.std(axis=0), [0.75, 0.75, 2.2], rtol=0.1)
    for lag in (1, 25, 75):
        correlation = np.mean(error[lag:] * error[:-lag], axis=0) / error.var(axis=0)
        np.testing.assert_allclose(correlation, np.exp(-lag / 25.0), atol=0.05)


@pytest.mark.slow
def test_each_stretch_has_a_bias_of_its_own() -> None:
    still = FixErrors(sigma_h_m=0.0, sigma_v_m=0.0, correlation_s=25.0, bias_h_m=0.45, bias_v_m=1.2)
    bias = np.array([gauss_markov(3, 1.0, still, rng(k)) for k in range(3000)])
    assert np.ptp(bias, axis=1).max() == 0.0
    np.testing.assert_allclose(bias[:, 0].std(axis=0), [0.45, 0.45, 1.2], rtol=0.05)


@pytest.mark.slow
def test_float_errors_are_as_large_as_a_real_receivers(data_dir: Path) -> None:
    rows = []
    with (data_dir / "survey/stationary.nmea").open("rb") as stream:
        for _, m in NMEAReader(stream):
            if m.msgID == "GGA" and m.quality in (4, 5):
                rows.append((m.quality, m.lat, m.lon, m.alt + m.sep))
    quality, *place = np.array(rows).T
    fixed = quality == 4
    origin = GeodeticPoint(*(float(x[fixed].mean()) for x in place))
    enu = to_enu(origin, *place)[~fixed]
    model = FIX_ERRORS[FixClass.RTK_FLOAT]
    horizontal = np.sqrt((enu[:, :2] ** 2).mean())
    assert np.hypot(model.sigma_h_m, model.bias_h_m) == pytest.approx(horizontal, rel=0.15)
    assert np.hypot(model.sigma_v_m, model.bias_v_m) == pytest.approx(
        np.sqrt((enu[:, 2] ** 2).mean()), rel=0.15
    )


@pytest.mark.slow
def test_gyro_integrates_to_the_true_rotation() -> None:
    config = replace(
        SCENES["spin"],
        spin_deg_s=200.0,
        gyro=GyroConfig(rate_hz=1000.0, noise_rad_s=0.0, bias_rad_s=0.0, bias_walk_rad_s_sqrt_s=0.0),
    )
    motion = build_motion(config, rng())
    t, rate, _ = simulate_gyro(motion, config, rng())
    assert t[0] == pytest.approx(-0.2) and t[-1] == pytest.approx(config.duration_s + 0.2, abs=1e-3)
    camera = rate @ gyro_R_camera(config.gyro)  # rows: the transpose takes gyro axes back to the camera's
    steps = Rotation.from_rotvec((camera[1:] + camera[:-1]) / 2 * np.diff(t)[:, None])
    turned = Rotation.identity()
    for step in steps:
        turned = turned * step
    begin, end = Rotation.from_matrix(motion.poses(t[[0, -1]])[:, :3, :3])
    assert np.rad2deg((turned.inv() * (begin.inv() * end)).magnitude()) < 0.01


@pytest.mark.slow
def test_gyro_noise_and_bias_have_their_size() -> None:
    motion = build_motion(WALK, rng())
    gyro = GyroConfig(noise_rad_s=0.002, bias_rad_s=0.01, bias_walk_rad_s_sqrt_s=0.0)
    t, rate, _ = simulate_gyro(motion, replace(WALK, gyro=gyro), rng())
    excess = rate - motion.rates(t) @ gyro_R_camera(gyro).T
    np.testing.assert_allclose((excess - excess.mean(axis=0)).std(axis=0), 0.002, rtol=0.05)
    assert 0.001 < np.linalg.norm(excess.mean(axis=0)) < 0.04
    walking = replace(gyro, noise_rad_s=0.0, bias_rad_s=0.0, bias_walk_rad_s_sqrt_s=0.001)
    ends = []
    for seed in range(40):
        t, rate, _ = simulate_gyro(motion, replace(WALK, gyro=walking), rng(seed))
        ends.append(rate[-1] - motion.rates(t[-1:])[0] @ gyro_R_camera(walking).T)
    assert np.std(ends) == pytest.approx(0.001 * np.sqrt(t[-1] - t[0]), rel=0.2)
