"""COLMAP, nerfstudio, KITTI, GeoJSON and KML, read back by the programs they are for where there are any."""

import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from colmap_model import ColmapModel
from scipy.spatial.transform import Rotation

from vgps.camera import project
from vgps.errors import RunFolderError
from vgps.model import Camera
from vgps.solution import FrameState, Landmarks, Observations
from vgps.writers.export import export
from vgps.writers.run_folder import write_run

PINHOLE = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.5, cy=241.0)
LENSES = {
    "pinhole": PINHOLE,
    "opencv": replace(PINHOLE, model="opencv", distortion=(-0.2, 0.05, 1e-3, -5e-4)),
    "opencv5": replace(PINHOLE, model="opencv", distortion=(-0.2, 0.05, 1e-3, -5e-4, 0.01)),
    "fisheye": replace(PINHOLE, model="fisheye", fx=400.0, fy=400.0, distortion=(0.03, -0.01, 2e-3, -1e-3)),
    "tsai": replace(PINHOLE, model="tsai", distortion=(1e-3, 2e-5), pixel_mm=(0.0075, 0.0071)),
}


def consistent(solution, camera, noise_px=0.5):
    """The fixture's run with five frames, forty points, and observations that are half a pixel off."""
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (5, 1, 1))
    turns = rng.normal(-90, 3, (5, 3)) * [1, 0, 0]
    poses[:, :3, :3] = Rotation.from_euler("xyz", turns, degrees=True).as_matrix()
    poses[:, :3, 3] = np.arange(5)[:, None] * [0.1, 0.5, 0.0]
    points = np.column_stack([rng.uniform(-3, 3, 40), rng.uniform(8, 20, 40), rng.uniform(-2, 2, 40)])
    frame, landmark = np.repeat(np.arange(5), 40), np.tile(np.arange(40), 5)
    offset = points[landmark] - poses[frame, :3, 3]
    p = (offset[:, None] @ poses[frame, :3, :3])[:, 0]
    pinhole = replace(camera, model="pinhole", distortion=())
    uv = project(pinhole, p) + rng.normal(0, noise_px, (200, 2))
    n = (5, 3)
    return replace(
        solution,
        camera=camera,
        t_s=np.arange(5.0),
        world_T_camera=poses,
        sigma_rotation_rad=np.ones(n),
        sigma_position_m=np.ones(n),
        state=(FrameState.TRACKED,) * 5,
        landmarks=Landmarks(points, np.full(40, 0.5), np.arange(40, dtype=np.uint8)),
        observations=Observations(frame, landmark, uv),
        world_p_before=None,
    ), np.linalg.norm(uv - project(pinhole, p), axis=1).mean()


def exported(solution, tmp_path, to, name):
    write_run(solution, tmp_path / "run")
    export(tmp_path / "run", to, tmp_path / name)
    return tmp_path / name


@pytest.mark.parametrize("lens", LENSES)
def test_a_colmap_model_has_the_poses_points_and_errors_of_the_run(solution, tmp_path, lens):
    """Read by COLMAP's documentation: files, axes, half-pixel centres and lens equations."""
    run, error_px = consistent(solution, LENSES[lens])
    model = ColmapModel(exported(run, tmp_path, "colmap", "sparse"))
    assert [image.name for image in model.images.values()] == [f"frame_{k:06d}.jpg" for k in range(5)]
    poses = np.array([np.linalg.inv(image.camera_T_world) for image in model.images.values()])
    np.testing.assert_allclose(poses, run.world_T_camera, atol=1e-9)
    np.testing.assert_allclose(np.array(list(model.points.values())), run.landmarks.world_p_landmark)
    # in the distorted image the same ray differs by another number of pixels
    tolerance = 1e-5 if lens in {"pinhole", "tsai"} else 0.3 * error_px
    assert model.reprojection_errors().mean() == pytest.approx(error_px, abs=tolerance)
    assert np.mean(list(model.errors_px.values())) == pytest.approx(error_px, abs=1e-5)
    # every track entry is an observation of its point, and none is missing
    entries = [(image, row) for track in model.tracks.values() for image, row in track]
    assert len(set(entries)) == len(entries) == len(run.observations.frame)
    for number, track in model.tracks.items():
        assert {model.images[image].point[row] for image, row in track} == {number}


@pytest.mark.parametrize("lens", LENSES)
def test_an_exact_colmap_model_has_no_reprojection_error(solution, tmp_path, lens):
    run, _ = consistent(solution, LENSES[lens], noise_px=0.0)
    model = ColmapModel(exported(run, tmp_path, "colmap", "sparse"))
    assert model.reprojection_errors().max() < 1e-5


@pytest.mark.parametrize("lens", LENSES)
def test_colmap_reads_the_model_with_the_same_error(solution, tmp_path, lens):
    pycolmap = pytest.importorskip("pycolmap", reason="COLMAP itself is the oracle: install vgps[bench]")
    run, error_px = consistent(solution, LENSES[lens])
    model = pycolmap.Reconstruction(exported(run, tmp_path, "colmap", "sparse"))
    assert (model.num_images(), model.num_points3D()) == (5, 40)
    # in the distorted image the same ray differs by another number of pixels
    tolerance = 1e-6 if lens in {"pinhole", "tsai"} else 0.3 * error_px
    model.update_point_3d_errors()
    assert model.compute_mean_reprojection_error() == pytest.approx(error_px, abs=tolerance)
    image = model.image(3)
    centre = image.projection_center()
    np.testing.assert_allclose(centre, run.world_T_camera[2, :3, 3], atol=1e-9)
    assert image.name == "frame_000002.jpg"


def test_colmap_lines_by_hand(solution, tmp_path):
    run, _ = consistent(solution, LENSES["pinhole"], noise_px=0.0)
    folder = exported(run, tmp_path, "colmap", "sparse")
    assert (folder / "cameras.txt").read_text() == "1 PINHOLE 640 480 500 510 321 241.5\n"
    lines = (folder / "images.txt").read_text().splitlines()
    assert len(lines) == 10 and len(lines[1].split()) == 3 * 40
    first = (folder / "points3D.txt").read_text().splitlines()[0].split()
    assert first[4:7] == ["0", "0", "0"] and float(first[7]) < 1e-5 and len(first) == 8 + 2 * 5
    assert json.loads((folder / "origin.json").read_text())["world_origin"]["latitude_deg"] == 49.011


@pytest.mark.parametrize("lens", ["pinhole", "opencv", "opencv5", "fisheye"])
def test_nerfstudio_has_opengl_cameras_in_the_same_world(solution, tmp_path, lens):
    run, _ = consistent(solution, LENSES[lens])
    found = json.loads(exported(run, tmp_path, "nerfstudio", "transforms.json").read_text())
    pose = np.array(found["frames"][2]["transform_matrix"])
    np.testing.assert_allclose(pose[:3, 3], run.world_T_camera[2, :3, 3])
    np.testing.assert_allclose(-pose[:3, 2], run.world_T_camera[2, :3, 2])  # both look along the same ray
    assert (found["w"], found["h"], found["fl_x"]) == (640, 480, LENSES[lens].fx)
    assert [found[k] for k in ("k1", "k2") if k in found] == list(LENSES[lens].distortion[:2])


def test_nerfstudio_refuses_a_lens_it_does_not_have(solution, tmp_path):
    with pytest.raises(RunFolderError, match="no lens model for tsai"):
        exported(consistent(solution, LENSES["tsai"])[0], tmp_path, "nerfstudio", "t.json")
    assert not (tmp_path / "t.json").exists()


def test_kitti_is_what_evo_reads(solution, tmp_path):
    file_interface = pytest.importorskip("evo.tools.file_interface", reason="evo is the oracle")
    read = file_interface.read_kitti_poses_file(exported(solution, tmp_path, "kitti", "poses.txt"))
    np.testing.assert_allclose(np.array(read.poses_se3), solution.world_T_camera, atol=1e-9)


def test_geojson_has_the_path_and_every_fix(solution, tmp_path):
    found = json.loads(exported(solution, tmp_path, "geojson", "run.geojson").read_text())
    line, *points = found["features"]
    longitude, latitude, height = line["geometry"]["coordinates"][0]
    assert (longitude, latitude) == pytest.approx((8.4165, 49.011), abs=1e-3)
    assert height == pytest.approx(163, abs=20)
    assert len(line["geometry"]["coordinates"]) == len(solution.t_s)
    assert [point["properties"]["verdict"] for point in points] == ["used"]  # the other has no place


def test_kml_parses_and_has_the_path_and_every_fix(solution, tmp_path):
    root = ET.parse(exported(solution, tmp_path, "kml", "run.kml")).getroot()
    space = {"k": "http://www.opengis.net/kml/2.2"}
    assert len(root.findall(".//k:LineString", space)) == 1 and len(root.findall(".//k:Point", space)) == 1
    coordinates = root.find(".//k:LineString/k:coordinates", space).text.split()
    assert len(coordinates) == len(solution.t_s)


@pytest.mark.parametrize("to", ["geojson", "kml"])
def test_without_georeference_there_is_no_map(solution, tmp_path, to):
    with pytest.raises(RunFolderError, match="not georeferenced"):
        exported(replace(solution, georeferenced=False), tmp_path, to, "x")
