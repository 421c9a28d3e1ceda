"""COLMAP models, read back by the documentation and by COLMAP."""

import json
from dataclasses import replace

import numpy as np
import pytest
from colmap_model import ColmapModel
from exports import LENSES, consistent, exported

from vgps.model import FocalChanges


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


@pytest.mark.parametrize("lens", [lens for lens in LENSES if lens != "tsai"])
def test_a_model_of_a_camera_that_zooms_is_one_of_the_original_images(solution, tmp_path, lens):
    """Each image has a camera; pixels lie as much further from the centre as its focal length is larger."""
    run, _ = consistent(solution, LENSES[lens], noise_px=0.0)
    changes = FocalChanges((0.0, 4.0), (-0.2, 0.2), (330.0, 230.0))
    zooming = replace(run, camera=replace(run.camera, focal_changes=changes))
    steady = ColmapModel(exported(run, tmp_path / "steady", "colmap", "sparse"))
    model = ColmapModel(exported(zooming, tmp_path / "zooming", "colmap", "sparse"))
    assert model.reprojection_errors().max() < 1e-5
    assert len(model.cameras) == 5 and model.cameras[3] == steady.cameras[1]
    for number, image in model.images.items():
        ratio = np.exp(0.1 * (number - 3))
        assert model.cameras[image.camera][1][0] == pytest.approx(ratio * run.camera.fx)
        centre = np.array([330.5, 230.5])
        expected = centre + ratio * (steady.images[number].uv_px - centre)
        np.testing.assert_allclose(image.uv_px, expected, atol=1e-5)


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
