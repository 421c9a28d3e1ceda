from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
from rendered_boards import CONFIG, board_and_corners, moving

from vgps.camera import centred_camera, project, undistort
from vgps.errors import ConfigError
from vgps.readers.calibration.camera_file import read_camera
from vgps.simulate import SCENES, Renderer, build_motion, build_world, simulate
from vgps.simulate.fisheye import pieces

DEGREES = 150.0
CAMERA = centred_camera("fisheye", (CONFIG.width, CONFIG.height), 400.0 / np.radians(DEGREES))
READOUT_S = 0.06


@pytest.mark.slow
@pytest.mark.parametrize("yaw", [0.0, 0.95, -0.9])
@pytest.mark.parametrize("readout_s", [0.0, READOUT_S])
def test_corners_are_where_the_lens_and_their_row_show_them(yaw: float, readout_s: float) -> None:
    """Up to 70 degrees off the axis; OpenCV's fisheye without coefficients is the oracle."""
    world, corners = board_and_corners()
    motion = moving((0.0, -1.0, 0.5, 0.6, 0.3, 0.0), start=(3.6, 0.0, 0.0, yaw, 0.0, 0.1))
    config = replace(CONFIG, fisheye_deg=DEGREES, readout_s=readout_s, exposure_s=1e-6)
    gray = cv2.cvtColor(Renderer(world, motion, config).frame(0), cv2.COLOR_BGR2GRAY)
    t_s, expected = np.zeros(len(corners)), np.zeros((len(corners), 2))
    for _ in range(20):  # the row depends on the time, and the time on the row
        poses = motion.poses(t_s)
        seen = np.einsum("nij,ni->nj", poses[:, :3, :3], corners - poses[:, :3, 3])
        expected = project(CAMERA, seen)
        t_s = readout_s * (expected[:, 1] / (CONFIG.height - 1) - 0.5)
    inside = np.all((expected > 8) & (expected < [CONFIG.width - 8, CONFIG.height - 8]), axis=1)
    assert inside.sum() >= 25
    start = expected[inside].astype(np.float32).reshape(-1, 1, 2)
    error = np.linalg.norm(
        cv2.cornerSubPix(gray, start.copy(), (3, 3), (-1, -1), (3, 50, 1e-4)) - start, axis=-1
    )
    assert np.median(error) < 0.15
    assert error.max() < 0.5


@pytest.mark.slow
def test_a_street_is_that_of_a_pinhole_bent() -> None:
    scene = replace(
        SCENES["demo"], width=240, height=160, texture_scale=0.3, noise_levels=0.0, exposure_s=1e-6
    )
    motion, world = (make(scene, np.random.default_rng(2)) for make in (build_motion, build_world))
    wide = Renderer(world, motion, replace(scene, fisheye_deg=110.0)).frame(20)
    camera = centred_camera("fisheye", (240, 160), np.hypot(240, 160) / np.radians(110.0))
    flat = replace(scene, width=640, height=480, focal_px=camera.fx)
    u, v = np.meshgrid(np.arange(240), np.arange(160))
    uv = undistort(camera, np.stack([u.ravel(), v.ravel()], axis=1)) - (camera.cx, camera.cy) + (319.5, 239.5)
    maps = uv.astype(np.float32).reshape(160, 240, 2)
    bent = cv2.remap(Renderer(world, motion, flat).frame(20), maps, None, cv2.INTER_LINEAR)
    difference = np.abs(bent.astype(int) - wide.astype(int)).max(axis=2)
    assert difference.mean() < 12.0 and np.mean(difference > 80) < 0.02


def test_pieces_cover_a_polygon() -> None:
    """Those of the ground before a camera: areas add up, and each is seen under a small angle."""
    ground = [(-9.0, 1.6, 0.2), (9.0, 1.6, 0.2), (9.0, 1.6, 30.0), (-9.0, 1.6, 30.0)]
    parts = [np.array(piece) for piece in pieces(ground)]
    areas = [
        0.5 * np.linalg.norm(sum(np.cross(p - piece[0], q - piece[0]) for p, q in pairwise(piece)))
        for piece in parts
    ]
    assert sum(areas) == pytest.approx(18.0 * 29.8)
    for piece in parts:
        rays = piece / np.linalg.norm(piece, axis=1, keepdims=True)
        assert (rays @ rays.T).min() > np.cos(np.radians(25.1))


@pytest.mark.slow
def test_the_recording_names_its_lens(tmp_path) -> None:
    scene = replace(SCENES["demo"], speed=((0.0, 1.2), (0.2, 1.2)), width=96, height=64, texture_scale=0.1)
    simulate(tmp_path / "wide", replace(scene, fisheye_deg=150.0))
    camera = read_camera(tmp_path / "wide" / "camera.yaml")
    assert camera.model == "fisheye" and camera.distortion == (0.0,) * 4
    corner = undistort(camera, [[-0.5, -0.5]]) - (camera.cx, camera.cy)
    assert np.hypot(*(corner[0] / camera.fx)) == pytest.approx(np.tan(np.radians(75.0)))
    with pytest.raises(ConfigError, match="a fisheye of 180 degrees"):
        simulate(tmp_path / "all", replace(scene, fisheye_deg=180.0))
