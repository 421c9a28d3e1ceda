"""Pictures wider than a plane from end to end: the same walk, the sphere and a fisheye beside a pinhole."""

from dataclasses import replace
from pathlib import Path

import pytest
from fewer_features import fewer_features
from PIL import Image

import vgps
from vgps.evaluation import evaluate
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, GpsConfig, simulate
from vgps.writers.export import export

pytestmark = pytest.mark.slow
WALK = replace(
    SCENES["demo"],
    speed=((0.0, 1.2), (3.0, 1.2)),
    fps=6,
    width=252,
    height=168,
    focal_px=150.0,  # 80 degrees, at 1.7 times the scale of the others
    texture_scale=0.25,
    gps=GpsConfig(fix_share=0.5, interval_s=0.5),
)
SPHERE = replace(WALK, width=564, height=282, panorama_deg=360.0)
CIRCLE = replace(WALK, width=306, height=306, panorama_deg=195.0)
FEWER_FEATURES = fewer_features(200)
NO_GPS = fewer_features(200, gps={"model": "none"})


def drift_m(folder: Path) -> float:
    """Mean error of the video alone after an alignment with scale."""
    solution = vgps.smooth(vgps.open_recording(folder), NO_GPS)
    error = evaluate(solution, read_trajectory(folder / "truth.tum")).camera_position_after_sim3_m
    assert error is not None
    return error.mean


@pytest.fixture(scope="module")
def pinhole_drift_m(tmp_path_factory: pytest.TempPathFactory) -> float:
    folder = tmp_path_factory.mktemp("pinhole") / "walk"
    simulate(folder, WALK)
    return drift_m(folder)


@pytest.fixture(scope="module")
def sphere(shared_folder) -> Path:
    return shared_folder("sphere", lambda out: simulate(out, SPHERE))


@pytest.fixture(scope="module")
def circle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("circle") / "walk"
    simulate(folder, CIRCLE)
    return folder


@pytest.mark.parametrize("walk", ["sphere", "circle"])
def test_a_wide_picture_drifts_less_than_a_pinhole(request, pinhole_drift_m, walk):
    wide = drift_m(request.getfixturevalue(walk))
    assert wide < 0.7 * pinhole_drift_m


def test_a_sphere_with_fixes_gives_poses_pictures_and_views(sphere, tmp_path):
    solution = vgps.smooth(vgps.open_recording(sphere), FEWER_FEATURES)
    vgps.write_run(solution, tmp_path / "run")
    run, truth = read_run(tmp_path / "run"), read_trajectory(sphere / "truth.tum")
    error = evaluate(run, truth)
    assert error.camera_position_m.mean < 0.05 and error.rotation_deg.mean < 1.0
    export(tmp_path / "run", "exif", tmp_path / "images")
    with Image.open(tmp_path / "images" / "frame_000000.jpg") as picture:
        assert picture.size == (run.camera.width, run.camera.height)
    assert all(len(view.landmarks.sigma_px) > 50 for view in run.cameras[:3])
