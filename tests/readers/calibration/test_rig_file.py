from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from vgps.errors import CalibrationError
from vgps.model import GeodeticPoint
from vgps.readers.calibration.rig_file import read_rig


def rig(folder: Path, text: str):
    path = folder / "rig.yaml"
    path.write_text(text)
    return read_rig(path)


def test_every_key_of_a_rig_is_read(tmp_path):
    read = rig(
        tmp_path,
        """
camera_p_antenna: [0.05, -0.93, -0.32]
video_start_utc: 2011-09-26T14:00:00.25+02:00
world_origin: [49.011, 8.4165, 163]
gyro_R_camera: [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
gyro_rotation_sigma_deg: [0.1, 0.2, 0.3]
gyro_time_offset_s: -0.02
gyro_time_offset_sigma_s: 0.001
gyro_bias_rad_s: [0.01, 0, -0.02]
gyro_bias_sigma_rad_s: [0.001, 0.001, 0.002]
exposure_s: 1e-2
video_start_s: 10.5
""",
    )
    assert read.camera_p_antenna.tolist() == [0.05, -0.93, -0.32] and read.antenna_known
    assert read.video_start_utc == datetime(2011, 9, 26, 12, 0, 0, 250000, UTC)
    assert read.world_origin == GeodeticPoint(49.011, 8.4165, 163.0)
    np.testing.assert_allclose(read.gyro_R_camera, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert (read.exposure_s, read.video_start_s) == (0.01, 10.5)
    assert (read.gyro_time_offset_s, read.gyro_bias_rad_s.tolist()) == (-0.02, [0.01, 0, -0.02])


@pytest.mark.parametrize(
    "cell", ["2011-09-26T12:00:00", "2011-09-26 12:00:00", "'2011-09-26T12:00:00Z'", "2011-09-26T12:00:00Z"]
)
def test_a_naive_start_is_utc(tmp_path, cell):
    start = rig(tmp_path, f"video_start_utc: {cell}\n").video_start_utc
    assert start == datetime(2011, 9, 26, 12, tzinfo=UTC)


def test_a_rig_may_say_nothing(tmp_path):
    read = rig(tmp_path, "# nothing known\n")
    assert read.camera_p_antenna.tolist() == [0, 0, 0] and not read.antenna_known
    assert read.video_start_utc is None
    assert read.gyro_R_camera is None
    assert (read.gyro_time_offset_s, read.gyro_bias_rad_s.tolist()) == (0, [0, 0, 0])


def test_a_printed_rotation_is_made_exact(tmp_path):
    c, s = 0.8660, 0.5
    R = rig(tmp_path, f"gyro_R_camera: [[{c}, {-s}, 0], [{s}, {c}, 0], [0, 0, 1]]\n").gyro_R_camera
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(R[0, 0], np.cos(np.radians(30)), atol=1e-4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "gyro_R_camera: [[2, 0, 0], [0, 1, 0], [0, 0, 1]]",
            "key gyro_R_camera: R R.T differs .* by 3; expected a rot",
        ),
        (
            "video_start_utc: 9999-12-31T23:59:59-10:00",
            "key video_start_utc: 9999.*expected UTC in the years",
        ),
        ("gyro_R_camera: [[1.0e+308, 0, 0], [0, 1, 0], [0, 0, 1]]", "key gyro_R_camera: R R.T differs"),
        ("gyro_R_camera: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "key gyro_R_camera: a reflection"),
        ("gyro_R_camera: [[1, 0], [0, 1]]", r"key gyro_R_camera\.0"),
        ("camera_p_antenna: [0, .nan, 0]", r"key camera_p_antenna\.1: nan; expected a finite number"),
        ("camera_p_antenna: [0, 0]", r"key camera_p_antenna\.2: missing"),
        ("world_origin: [149, 8, 100]", r"key world_origin\.0: 149; expected less than or equal to 90"),
        ("antenna: [0, 0, 0]", "key antenna: unknown key"),
        ("video_start_utc: noon", "key video_start_utc: 'noon'"),
        ("exposure_s: -1", "key exposure_s: -1"),
    ],
)
def test_an_impossible_rig_names_its_key(tmp_path, text, message):
    with pytest.raises(CalibrationError, match=message):
        rig(tmp_path, text + "\n")


def test_real_rigs_say_when_the_video_began(data_dir):
    assert read_rig(data_dir / "kitti03/rig.yaml").video_start_utc == datetime(2011, 9, 26, 12, tzinfo=UTC)
    assert read_rig(data_dir / "kitti03_shake/rig.yaml").video_start_s == 10.0


def test_an_antenna_in_millimetres_is_doubted(tmp_path, caplog):
    (tmp_path / "rig.yaml").write_text("camera_p_antenna: [0, -300, 0]\n")
    assert read_rig(tmp_path / "rig.yaml").camera_p_antenna[1] == -300.0  # it may be a large ship
    assert "the antenna is 300 m from the camera: camera_p_antenna is in metres" in caplog.text
