"""Calibrations that other programs write; cv2 and pycolmap write or project them as oracles."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from colmap_model import colmap_pixels

from vgps.camera import project
from vgps.errors import CalibrationError
from vgps.model import Camera
from vgps.readers.calibration.camera_file import read_camera
from vgps.writers.colmap import colmap_camera

K = np.array([[500.0, 0, 320.5], [0, 510.0, 240.25], [0, 0, 1]])
KALIBR = {
    "camera_model": "pinhole",
    "distortion_model": "radtan",
    "intrinsics": [500.0, 510.0, 320.5, 240.25],
    "distortion_coeffs": [0.1, -0.2, 0.003, -0.004],
    "resolution": [640, 480],
    "rostopic": "/cam0/image_raw",
    "T_cam_imu": np.eye(4).tolist(),
}
FLAT = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.5, cy=240.25)
CAMERAS = [
    FLAT,
    replace(FLAT, model="opencv", distortion=(0.1, -0.2, 0.003, -0.004)),
    replace(FLAT, model="opencv", distortion=(0.1, -0.2, 0.003, -0.004, 0.05, 0.01, 0.02, 0.03)),
    replace(FLAT, model="fisheye", distortion=(0.1, -0.02, 0.003, -0.0004)),
]

COLMAP_CAMERAS = [
    ("SIMPLE_PINHOLE", [500, 320, 240]),
    ("PINHOLE", [500, 510, 320, 240]),
    ("SIMPLE_RADIAL", [500, 320, 240, -0.1]),
    ("RADIAL", [500, 320, 240, -0.1, 0.02]),
    ("OPENCV", [500, 510, 320, 240, -0.1, 0.02, 0.003, -0.004]),
    ("FULL_OPENCV", [500, 510, 320, 240, -0.1, 0.02, 0.003, -0.004, 0.01, 0.02, 0.03, 0.04]),
    ("SIMPLE_RADIAL_FISHEYE", [500, 320, 240, -0.1]),
    ("RADIAL_FISHEYE", [500, 320, 240, -0.1, 0.02]),
    ("OPENCV_FISHEYE", [500, 510, 320, 240, -0.1, 0.02, 0.003, -0.004]),
]


@pytest.fixture
def read(tmp_path: Path):
    def written(content: str | bytes | dict, name: str = "lens.yaml") -> Camera:
        file = tmp_path / name
        if isinstance(content, dict):
            content = yaml.safe_dump(content)
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        return read_camera(file)

    return written


def storage(file: Path, distortion, names=("camera_matrix", "distortion_coefficients"), **more) -> Path:
    """What OpenCV itself writes; the suffix is its choice of YAML, XML or JSON."""
    with_file = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    for key, value in {"image_width": 640, "image_height": 480, **more}.items():
        with_file.write(key, value)
    with_file.write(names[0], K)
    if distortion is not None:
        with_file.write(names[1], np.array(distortion, float))
    with_file.release()
    return file


@pytest.mark.parametrize("suffix", ["yml", "yaml", "xml", "json"])
@pytest.mark.parametrize("shape", [(1, 5), (5, 1)])
def test_opencv_storage_in_each_of_its_syntaxes(tmp_path, suffix, shape):
    k = [0.1, -0.2, 0.003, -0.004, 0.05]
    file = storage(tmp_path / f"calibration.{suffix}", np.reshape(k, shape))
    expected = replace(FLAT, model="opencv", distortion=tuple(k))
    assert read_camera(file) == expected
    # by content, whatever its name
    assert read_camera(file.rename(tmp_path / "lens.dat")) == expected


def test_opencv_storage_of_other_lenses(tmp_path):
    assert read_camera(storage(tmp_path / "a.yml", None)) == CAMERAS[0]
    k = [0.1, -0.02, 0.003, -0.0004]
    assert read_camera(storage(tmp_path / "b.yml", k, fisheye_model=1)) == CAMERAS[3]
    assert read_camera(storage(tmp_path / "c.yml", k, distortion_model="equidistant")) == CAMERAS[3]
    assert read_camera(storage(tmp_path / "d.yml", k, fisheye_model=0)).model == "opencv"
    names = ("cameraMatrix", "distCoeffs")
    assert read_camera(storage(tmp_path / "e.yml", CAMERAS[2].distortion, names)) == CAMERAS[2]
    long = [*CAMERAS[2].distortion, *[0.0] * 6]
    assert read_camera(storage(tmp_path / "f.yml", long)) == CAMERAS[2]
    with pytest.raises(CalibrationError, match=r"14 coefficients; expected 4 or 5 or 8"):
        read_camera(storage(tmp_path / "g.yml", [*long[:-1], 0.1]))


def test_opencv_size_as_a_sequence(read):
    text = "%YAML:1.0\n---\nimageSize: [ 640, 480 ]\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    text += "   data: [ 500., 0., 320.5, 0., 510., 240.25, 0., 0., 1. ]\n"
    assert read(text) == CAMERAS[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("image_width: 640\n", ""), r"key image_width: missing; add image_width and image_height"),
        (("camera_matrix", "matrix_of_camera"), r"key camera_matrix: none; expected a 3 x 3 matrix"),
        (("rows: 3\n   cols: 3", "rows: 1\n   cols: 9"), r"key camera_matrix: shape \(1, 9\)"),
        (("5.0000000000000000e+02, 0.", "5.0000000000000000e+02, 2."), r"skew 2"),
        (("500.", "-500."), r"key fx: -500"),
        (("dt: d", "dt: ["), "damaged OpenCV storage"),
        (("data: [", "data: [ 1, "), "key camera_matrix: no matrix"),
    ],
)
def test_a_bad_opencv_storage_is_refused_in_one_line(tmp_path, read, change, message):
    text = storage(tmp_path / "a.yml", None).read_text()
    text = text.replace("500., 0.", "5.0000000000000000e+02, 0.") if "e+02" in change[0] else text
    assert change[0] in text
    with pytest.raises(CalibrationError, match=message) as error:
        read(text.replace(*change))
    assert "lens.yaml" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_a_truncated_opencv_storage_is_refused_or_complete(tmp_path, read, suffix):
    """YAML that ends between two keys is whole; it is the camera without the keys that are lost."""
    whole = storage(tmp_path / f"a.{suffix}", CAMERAS[1].distortion).read_bytes()
    between = whole.find(b"distortion_coefficients") if suffix == "yml" else len(whole)
    end = len(whole.rstrip()) - 1
    for cut in [*range(0, end, 7), end]:
        if suffix == "yml" and between - 2 <= cut <= between + len("distortion_coefficients:"):
            continue
        with pytest.raises(CalibrationError, match=r"lens\.yaml"):
            read(whole[:cut])
    assert read(whole) == CAMERAS[1]


def test_kalibrs_chain_of_one_camera(read):
    assert read({"cam0": KALIBR}) == CAMERAS[1]
    fisheye = {**KALIBR, "distortion_model": "equidistant", "distortion_coeffs": [0.1, -0.02, 0.003, -0.0004]}
    assert read({"cam0": fisheye}) == CAMERAS[3]
    assert read({"cam1": {**KALIBR, "distortion_model": "none", "distortion_coeffs": []}}) == CAMERAS[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"cam0": {**KALIBR, "camera_model": "omni"}}, r"key cam0\.camera_model: 'omni'; expected pinhole"),
        (
            {"cam0": {**KALIBR, "camera_model": ["pinhole"]}},
            r"key cam0\.camera_model: \['pinhole'\]; expected",
        ),
        ({"cam0": {**KALIBR, "distortion_model": {"a": 1}}}, r"distortion_model: \{'a': 1\}; expected equid"),
        ({"cam0": {**KALIBR, "distortion_model": "fov"}}, r"'fov'; expected equidistant or none or radtan"),
        ({"cam0": {**KALIBR, "intrinsics": [1, 2, 3]}}, r"key cam0\.intrinsics: .* a list of 4 numbers"),
        ({"cam0": {**KALIBR, "intrinsics": "wide"}}, r"key cam0\.intrinsics: 'wide'"),
        ({"cam0": {**KALIBR, "resolution": [640, None]}}, r"key cam0\.resolution"),
        ({"cam0": {**KALIBR, "resolution": [float("nan"), 480]}}, r"key width: nan"),
        ({"cam0": {k: v for k, v in KALIBR.items() if k != "distortion_coeffs"}}, r"distortion_coeffs: None"),
        ({"cam0": [1, 2]}, r"key cam0: no fields"),
        ({"cam0": KALIBR, "cam1": KALIBR}, r"2 cameras \(cam0, cam1\); expected one; keep only the camera"),
    ],
)
def test_a_bad_chain_is_refused_in_one_line(read, content, message):
    with pytest.raises(CalibrationError, match=message) as error:
        read(content)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("camera", CAMERAS)
def test_what_is_exported_to_colmap_reads_back(read, camera):
    name, parameters = colmap_camera(camera)
    line = f"1 {name} 640 480 " + " ".join(map(repr, parameters))
    back = read(f"# Camera list with one line of data per camera:\n{line}\n", "cameras.txt")
    assert (back.model, back.width, back.fx, back.cx, back.cy) == (
        camera.model,
        640,
        camera.fx,
        camera.cx,
        camera.cy,
    )
    np.testing.assert_allclose(back.distortion, camera.distortion, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "parameters"), COLMAP_CAMERAS)
@pytest.mark.parametrize("oracle", ["documented equations", "pycolmap"])
def test_colmaps_lens_models_project_as_colmap_does(read, name, parameters, oracle):
    camera = read(f"7 {name} 640 480 " + " ".join(map(str, parameters)), "cameras.txt")
    points = np.array([[0.1, 0.2, 2.0], [-0.5, 0.3, 1.5], [0.4, -0.4, 1.0], [0.0, 0.0, 3.0]])
    if oracle == "pycolmap":
        pycolmap = pytest.importorskip("pycolmap", reason="COLMAP's own lenses: install vgps[bench]")
        theirs = pycolmap.Camera(model=name, width=640, height=480, params=parameters)
        pixels = np.array([theirs.img_from_cam(point) for point in points]).reshape(-1, 2)
    else:
        pixels = colmap_pixels(name, parameters, points)
    np.testing.assert_allclose(project(camera, points), pixels - 0.5, atol=1e-6)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1 OPENCV 640 480 500 510 320 240", "line 2: .* expected 8 numbers for OPENCV"),
        ("1 PINHOLE 640 480 500 510 320 wide", "expected 4 numbers for PINHOLE"),
        ("1 FOV 640 480 500 510 320 240 0.9", "camera model FOV; expected SIMPLE_PINHOLE, PINHOLE"),
        ("1 PINHOLE 0 480 500 510 320 240", "key width: 0"),
        ("1 PINHOLE 4 4 5 5 2 2\n2 PINHOLE 4 4 5 5 2 2", r"2 cameras \(1, 2\); expected one"),
    ],
)
def test_a_bad_line_of_colmap_is_refused(read, line, message):
    with pytest.raises(CalibrationError, match=message):
        read(f"# comment\n{line}\n", "cameras.txt")


def test_camera_yaml_reads_as_before(read):
    text = "model: pinhole\nwidth: 640\nheight: 480\nfx: 500\nfy: 510\ncx: 320.5\ncy: 240.25\n"
    assert read(text) == CAMERAS[0]
    with pytest.raises(CalibrationError, match="key focal: unknown key"):
        read(text + "focal: 3\n")
