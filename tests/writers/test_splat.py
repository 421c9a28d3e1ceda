"""A splatting scene as its trainers' parsers see it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from distinct_solution import distinct_values
from exports import LENSES, consistent, exported
from PIL import Image

from vgps.camera import distort
from vgps.geodesy import to_geodetic
from vgps.writers.frame_choice import FrameChoice
from vgps.writers.splat import _lens_map, _undistorted


@pytest.fixture(scope="module")
def scene(true_run, tmp_path_factory):
    choice = FrameChoice(select="sharp", every_s=0.5)
    folder = tmp_path_factory.mktemp("splat")
    return exported(true_run, folder, "splat", "scene", choice=choice, crs="EPSG:32653")


@pytest.mark.slow
def test_the_scene_lies_near_its_origin_and_says_where_that_is(scene, true_run):
    about = json.loads((scene / "georeference.json").read_text())
    cameras = json.loads((scene / "transforms.json").read_text())["frames"]
    places = np.array([frame["transform_matrix"] for frame in cameras])[:, :3, 3]
    assert np.abs(places.mean(axis=0)).max() < 1e-3
    origin = about["world_origin"]
    found = to_geodetic(tuple(origin.values()), places)
    rows = [int(frame["file_path"][-10:-4]) for frame in cameras]
    expected = to_geodetic(true_run.world_origin, true_run.world_T_camera[rows, :3, 3])
    np.testing.assert_allclose(found[:, :2], expected[:, :2], atol=1e-9)
    np.testing.assert_allclose(found[:, 2], expected[:, 2], atol=1e-4)
    assert about["height_datum"] == "height above the WGS 84 ellipsoid"
    assert about["in_crs"]["crs"] == "WGS 84 / UTM zone 53N (EPSG:32653)"
    assert sorted(file.name for file in (scene / "images").iterdir()) == [
        frame["file_path"].removeprefix("images/") for frame in cameras
    ]


@pytest.mark.slow
def test_colmap_reads_the_model(scene):
    pycolmap = pytest.importorskip("pycolmap")
    model = pycolmap.Reconstruction(scene / "sparse/0")
    names = sorted(image.name for image in model.images.values())
    assert names == sorted(file.name for file in (scene / "images").iterdir())
    (camera,) = model.cameras.values()
    assert camera.model_name == "PINHOLE"
    with Image.open(scene / "images" / names[0]) as picture:
        assert picture.size == (camera.width, camera.height)


@pytest.mark.slow
def test_nerfstudio_s_parser_reads_the_model(scene):
    parser = pytest.importorskip("nerfstudio.data.utils.colmap_parsing_utils", exc_type=ImportError)
    images = parser.read_images_text(scene / "sparse/0/images.txt")
    cameras = parser.read_cameras_text(scene / "sparse/0/cameras.txt")
    assert len(images) == len(list((scene / "images").iterdir()))
    assert cameras[1].model == "PINHOLE"


@pytest.mark.slow
def test_observations_are_those_of_the_undistorted_images(tmp_path):
    """Landmarks of a distorting lens reproject within the noise into the pinhole images of the scene."""
    pycolmap = pytest.importorskip("pycolmap")
    run, _ = consistent(distinct_values(), LENSES["opencv"])
    frames = tmp_path / "frames"
    frames.mkdir()
    for frame in range(5):
        Image.new("RGB", (640, 480), (frame, 0, 0)).save(frames / f"{frame}.png")
    (frames / "frame_times.csv").write_text("frame,t_s\n" + "".join(f"{k},{k}\n" for k in range(5)))
    scene = exported(replace(run, recording=frames), tmp_path, "splat", "scene")
    model = pycolmap.Reconstruction(scene / "sparse/0")
    assert model.compute_mean_reprojection_error() < 1.0


def test_a_point_keeps_its_place_in_the_undistorted_image():
    camera = replace(LENSES["fisheye"], width=320, height=240, fx=150.0, fy=150.0, cx=160.0, cy=120.0)
    at = np.array([[250.0, 60.0]])
    (u, v) = distort(camera, at)[0]
    y, x = np.mgrid[:240, :320]
    spot = 255 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / 8)
    shown = _undistorted(np.repeat(spot[..., None], 3, axis=2).astype(np.uint8), _lens_map(camera))[..., 0]
    weight = shown.astype(float)
    centre = (weight * x).sum() / weight.sum(), (weight * y).sum() / weight.sum()
    np.testing.assert_allclose(centre, at[0], atol=0.3)
