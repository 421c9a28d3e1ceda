"""GoPros with a stabilised picture: its own rotations count, and what turns otherwise is left out."""

from pathlib import Path

import numpy as np
import pytest
from gpmf_bytes import device, encode, stream, telemetry, text
from scipy.spatial.transform import Rotation

from vgps.model import Camera, GyroLog, ImuLog, ImuMount, Recording, Rig
from vgps.readers.gopro import stabilisation
from vgps.readers.gopro.gpmf import parse
from vgps.readers.gopro.stabilisation import with_picture_motion
from vgps.readers.recording import open_recording

CAMERA = Camera(model="pinhole", width=64, height=48, fx=50, fy=50, cx=32, cy=24)
RATE_DEG_S = 30.0


def quaternions(key: str, degrees: np.ndarray) -> bytes:
    """Rotations about the camera's y axis, as the camera writes them: w first, scaled."""
    turns = np.radians(degrees)[:, None] * [0.0, 1.0, 0.0]
    quaternion = Rotation.from_rotvec(turns).as_quat()[:, [3, 0, 1, 2]]
    rows = np.round(32767 * quaternion).astype(int).tolist()
    return stream(encode(key, "s", rows), encode("SCAL", "s", [[32767]]), stamp_us=0)


def made(image_deg: float | None):
    """A second of a body that turns, and of a picture that turns on it to and fro."""
    t_s = np.arange(30) / 30
    streams = [stream(encode("SHUT", "f", [[0.01]] * 30), stamp_us=0)]
    if image_deg is not None:
        streams.append(quaternions("CORI", -RATE_DEG_S * t_s))
        streams.append(quaternions("IORI", image_deg * t_s))
    return telemetry(device("HERO9 Black", *streams))


def recording(found, source: Path | None = None) -> Recording:
    source = source or found.path
    t_s, three, never = np.arange(10) / 10, np.zeros((10, 3)), np.zeros(10, bool)
    force = np.tile([5.0, 9.0, 0.0], (10, 1))
    imu = ImuLog(t_s=t_s, rate_rad_s=three, force_m_s2=force, saturated=never, source=source)
    mount = ImuMount(
        imu_R_camera=np.diag([-1.0, -1.0, 1.0]),
        imu_p_camera=np.array([0.0, 0.0, 0.1]),
        accelerometer_bias_m_s2=np.array([-0.2, 0.0, 0.0]),
    )
    return Recording(
        path=found.path,
        video=None,
        camera=CAMERA,
        rig=Rig(gyro_R_camera=-np.eye(3), imu=mount),
        gyro=GyroLog(t_s, three, source),
        imu=imu,
    )


def test_rates_of_a_stabilised_picture_are_its_own():
    found = with_picture_motion(recording(made(12.0)), made(12.0))
    np.testing.assert_array_equal(found.rig.gyro_R_camera, np.eye(3))
    # the picture turns back by 12 of the 30 degrees that the body turns in a second
    expected = np.radians(RATE_DEG_S - 12.0)
    np.testing.assert_allclose(found.gyro.rate_rad_s, np.tile([0.0, expected, 0.0], (29, 1)), atol=0.01)
    assert "stand in for the camera's gyro, and the accelerometer is turned with it" in found.notes[0]


def test_an_imu_beside_a_stabilised_picture_is_turned_with_it():
    found = with_picture_motion(recording(made(12.0)), made(12.0))
    np.testing.assert_array_equal(found.rig.imu.imu_R_camera, np.eye(3))
    np.testing.assert_allclose(found.rig.imu.imu_p_camera, [0.0, 0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(found.rig.imu.accelerometer_bias_m_s2, [0.2, 0.0, 0.0], atol=1e-12)
    log = found.imu
    assert log.t_s[0] == 0.0 and 0.85 < log.t_s[-1] < 29 / 30 and len(log.t_s) == len(log.saturated)
    expected = np.radians(RATE_DEG_S - 12.0)
    np.testing.assert_allclose(log.rate_rad_s, np.tile([0.0, expected, 0.0], (len(log.t_s), 1)), atol=0.01)
    # the body's own axes are those of a camera turned by half a turn about z; the image turns about y on it
    angle = np.radians(12.0 * log.t_s)
    expected = np.stack([-5.0 * np.cos(angle), np.full(len(angle), -9.0), 5.0 * np.sin(angle)], axis=1)
    np.testing.assert_allclose(log.force_m_s2, expected, atol=2e-3)


def test_a_picture_that_stays_on_the_body_keeps_the_sensors():
    before = recording(made(0.2))
    assert with_picture_motion(before, made(0.2)) is before


def test_a_stabilised_picture_without_a_record_loses_the_sensors(monkeypatch):
    monkeypatch.setattr(stabilisation, "gopro_settings", lambda path: {})
    before = recording(made(None))
    assert with_picture_motion(before, made(None)) is before
    (entry,) = parse(text("EISE", "Y"))
    monkeypatch.setattr(stabilisation, "gopro_settings", lambda path: {"EISE": entry})
    found = with_picture_motion(before, made(None))
    assert found.gyro is None and found.imu is None
    assert "turn otherwise, are left out" in found.notes[0]


def test_sensors_of_the_user_stay(tmp_path):
    before = recording(made(12.0), tmp_path / "gyro.csv")
    assert with_picture_motion(before, made(12.0)) is before


@pytest.mark.parametrize(
    ("name", "samples", "words"),
    [("gopro_walk", 315, "stand in for the camera's gyro"), ("gopro_hero7", None, "are left out")],
)
def test_real_stabilised_walks_note_what_stands_in_for_the_gyro(data_dir, name, samples, words):
    opened = open_recording(data_dir / name / "video.mp4", camera=None)
    assert (None if opened.gyro is None else len(opened.gyro.t_s)) == samples
    assert (opened.imu is None) == (samples is None) and words in opened.notes[0]
