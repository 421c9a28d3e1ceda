"""``transforms.json`` for nerfstudio and Instant NGP."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vgps.crs import ELLIPSOIDAL
from vgps.errors import RunFolderError
from vgps.solution import Solution
from vgps.writers.colmap import colmap_camera, frame_cameras

_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL's camera: x right, y up, z backward
_INTRINSICS = "fl_x", "fl_y", "cx", "cy"
_LENS = {"OPENCV": ("k1", "k2", "p1", "p2"), "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"), "PINHOLE": ()}


def write_nerfstudio(solution: Solution, out: Path, names: Sequence[str]) -> None:
    """Write intrinsics and a pose per frame, whose image is ``images/frame_000000.jpg`` and so on.

    The world is ENU, z up, in metres, and not normalised, so that results keep position and scale.

    Raises:
        RunFolderError: nerfstudio does not have the lens model.
    """
    name, parameters = colmap_camera(solution.camera)
    if name == "FULL_OPENCV" and not any(parameters[9:]):
        lens = dict(zip(("k1", "k2", "p1", "p2", "k3"), parameters[4:9], strict=True))
        name = "OPENCV"
    elif name in _LENS and solution.camera.model != "tsai":
        lens = dict(zip(_LENS[name], parameters[4:], strict=True))
    else:
        raise RunFolderError(
            f"nerfstudio has no lens model for {solution.camera.model} with these coefficients",
            expected="pinhole, opencv with at most five, or fisheye",
            remedy="undistort the images first",
        )
    poses = solution.world_T_camera @ _OPENGL
    frames = [
        {"file_path": f"images/{name}", "transform_matrix": pose, "t_s": t_s}
        for name, pose, t_s in zip(names, poses.tolist(), solution.t_s.tolist(), strict=True)
    ]
    if solution.camera.focal_changes is not None:
        for frame, camera in zip(frames, frame_cameras(solution), strict=True):
            frame |= dict(zip(_INTRINSICS, colmap_camera(camera)[1][:4], strict=True))
    document = {
        "camera_model": "OPENCV" if name == "PINHOLE" else name,
        "w": solution.camera.width,
        "h": solution.camera.height,
        **dict(zip(_INTRINSICS, parameters[:4], strict=True)),
        **lens,
        "world_origin": None if solution.world_origin is None else solution.world_origin._asdict(),
        "height_datum": ELLIPSOIDAL,
        "frames": frames,
    }
    out.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
