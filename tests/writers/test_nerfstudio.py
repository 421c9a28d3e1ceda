import json
from dataclasses import replace

import numpy as np
import pytest
from exports import LENSES, consistent, exported

from vgps.errors import RunFolderError
from vgps.model import FocalChanges


@pytest.mark.parametrize("lens", ["pinhole", "opencv", "opencv5", "fisheye"])
def test_nerfstudio_has_opengl_cameras_in_the_same_world(solution, tmp_path, lens):
    run, _ = consistent(solution, LENSES[lens])
    found = json.loads(exported(run, tmp_path, "nerfstudio", "transforms.json").read_text())
    pose = np.array(found["frames"][2]["transform_matrix"])
    np.testing.assert_allclose(pose[:3, 3], run.world_T_camera[2, :3, 3])
    np.testing.assert_allclose(-pose[:3, 2], run.world_T_camera[2, :3, 2])  # both look along the same ray
    assert (found["w"], found["h"], found["fl_x"]) == (640, 480, LENSES[lens].fx)
    assert [found[k] for k in ("k1", "k2") if k in found] == list(LENSES[lens].distortion[:2])


def test_nerfstudio_has_the_focal_length_of_each_frame_of_a_camera_that_zooms(solution, tmp_path):
    run, _ = consistent(solution, LENSES["opencv"])
    changes = FocalChanges((0.0, 4.0), (0.0, 0.4), (run.camera.cx, run.camera.cy))
    run = replace(run, camera=replace(run.camera, focal_changes=changes))
    found = json.loads(exported(run, tmp_path, "nerfstudio", "transforms.json").read_text())
    for k, frame in enumerate(found["frames"]):
        ratio = np.exp(0.1 * k)
        expected = [ratio * run.camera.fx, ratio * run.camera.fy, run.camera.cx + 0.5, run.camera.cy + 0.5]
        assert [frame[name] for name in ("fl_x", "fl_y", "cx", "cy")] == pytest.approx(expected)


def test_nerfstudio_refuses_a_lens_it_does_not_have(solution, tmp_path):
    with pytest.raises(RunFolderError, match="no lens model for tsai"):
        exported(consistent(solution, LENSES["tsai"])[0], tmp_path, "nerfstudio", "t.json")
    assert not (tmp_path / "t.json").exists()
