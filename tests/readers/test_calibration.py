from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import yaml

from vgps.camera import camera_fields, undistort
from vgps.errors import CalibrationError
from vgps.model import Camera, GeodeticPoint
from vgps.readers.calibration import read_camera, read_rig

PINHOLE = {
    "model": "pinhole",
    "width": 640,
    "height": 480,
    "fx": 500.0,
    "fy": 510.0,
    "cx": 320.0,
    "cy": 240.0,
}
FLAT = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.0, cy=240.0)
TSAI = {
    "model": "tsai",
    "width": 720,
    "height": 480,
    "focal_mm": 3.6,
    "ccd_mm": [4.8, 3.6],
    "scale": 1.02,
    "cx": 355.0,
    "cy": 238.0,
    "kappa": [8e-3, 1e-4],
}


def camera(folder: Path, fields: dict | str):
    path = folder / "camera.yaml"
    path.write_text(fields if isinstance(fields, str) else yaml.safe_dump(fields))
    return read_camera(path)


def rig(folder: Path, text: str):
    path = folder / "rig.yaml"
    path.write_text(text)
    return read_rig(path)


@pytest.mark.parametrize(
    "expected",
    [
        FLAT,
        replace(FLAT, model="opencv", distortion=(0.1, 0.2, 0.3, 0.4)),
        replace(FLAT, model="opencv", distortion=(0.1, 0.2, 0.3, 0.4, 0.5)),
        replace(FLAT, model="opencv", distortion=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)),
        replace(FLAT, model="fisheye", distortion=(0.1, 0.2, 0.3, 0.4)),
        replace(FLAT, model="tsai", distortion=(0.1, 0.2), pixel_mm=(0.01, 0.02)),
        replace(FLAT, readout_s=0.02),
        replace(FLAT, readout_s=-0.01),
        replace(FLAT, readout_s=0.0),
        replace(FLAT, readout_s=0.02, readout_axis="columns"),
    ],
)
def test_what_is_written_reads_back(tmp_path, expected):
    assert camera(tmp_path, camera_fields(expected)) == expected


def test_the_parameters_of_the_thesis(tmp_path):
    """Eq. (4), Kume 2010: u = scr_x / ccd_x * X / Z * F * s_x + C_x."""
    tsai = camera(tmp_path, TSAI)
    assert tsai.fx == pytest.approx(720 / 4.8 * 3.6 * 1.02)
    assert tsai.fy == pytest.approx(480 / 3.6 * 3.6)
    assert tsai.pixel_mm == pytest.approx((4.8 / (720 * 1.02), 3.6 / 480))
    rho2 = (4.8 / (720 * 1.02) * 300) ** 2
    flat = undistort(tsai, [[655.0, 238.0]])
    np.testing.assert_allclose(flat, [[355 + 300 * (1 + 8e-3 * rho2 + 1e-4 * rho2**2), 238.0]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fx": -500}, r"key fx: -500; expected greater than 0"),
        ({"fx": float("nan")}, r"key fx: nan; expected a finite number"),
        ({"fx": "wide"}, r"key fx: 'wide'; expected a valid number"),
        ({"width": 640.5}, "key width"),
        ({"width": 10**400}, "key width: .* less than or equal to 1000000"),
        ({"model": "brown"}, "key model: 'brown'; expected 'pinhole', 'opencv', 'fisheye' or 'tsai'"),
        ({"foo": 1}, "key foo: unknown key; known keys: model, width"),
        ({"widht": 1}, r"key widht: unknown key; did you mean width\?"),
        ({"distortion": [0.1]}, "key distortion: 1 coefficients; expected 0 for model pinhole"),
        ({"model": "opencv"}, "0 coefficients; expected 4 or 5 or 8 for model opencv"),
        ({"model": "tsai", "distortion": [0.1, 0.2]}, "key pixel_mm: missing"),
        ({"pixel_mm": [1, 1]}, "key pixel_mm: given for model pinhole"),
    ],
)
def test_an_impossible_camera_names_its_key(tmp_path, change, message):
    with pytest.raises(CalibrationError, match=message) as error:
        camera(tmp_path, PINHOLE | change)
    assert "camera.yaml" in str(error.value)


def test_a_missing_key_is_named(tmp_path):
    fields = {key: value for key, value in PINHOLE.items() if key != "cx"}
    with pytest.raises(CalibrationError, match="key cx: missing; add cx"):
        camera(tmp_path, fields)
    with pytest.raises(CalibrationError, match="key kappa: missing; add kappa"):
        camera(tmp_path, {key: value for key, value in TSAI.items() if key != "kappa"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("# nothing\n", "no fields"),
        ("- 1\n- 2\n", "no fields"),
        ("model: [pinhole\nwidth: 3", "line 2: not YAML"),
        ("model: \x01", "not YAML"),
        ("video_start_utc: 2011-19-26T12:00:00", "month must be in"),
    ],
)
def test_a_file_that_is_not_yaml_is_refused(tmp_path, text, message):
    with pytest.raises(CalibrationError, match=message):
        camera(tmp_path, text)
    with pytest.raises(CalibrationError, match=r"none\.yaml: cannot be read"):
        read_camera(tmp_path / "none.yaml")


def test_a_whole_rig(tmp_path):
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


def test_the_real_files(data_dir):
    assert read_camera(data_dir / "gopro_walk/camera.yaml").distortion == (-0.1435, 0, 0, 0)
    assert read_rig(data_dir / "kitti03/rig.yaml").video_start_utc == datetime(2011, 9, 26, 12, tzinfo=UTC)
    assert read_rig(data_dir / "kitti03_shake/rig.yaml").video_start_s == 10.0


def test_an_antenna_in_millimetres_is_doubted(tmp_path, caplog):
    (tmp_path / "rig.yaml").write_text("camera_p_antenna: [0, -300, 0]\n")
    assert read_rig(tmp_path / "rig.yaml").camera_p_antenna[1] == -300.0  # it may be a large ship
    assert "the antenna is 300 m from the camera: camera_p_antenna is in metres" in caplog.text
