from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from vgps.camera import camera_fields, undistort
from vgps.errors import CalibrationError
from vgps.model import Camera
from vgps.readers.calibration.camera_file import read_camera

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


def test_a_real_camera_has_its_distortion(data_dir):
    assert read_camera(data_dir / "gopro_walk/camera.yaml").distortion == (-0.1435, 0, 0, 0)
