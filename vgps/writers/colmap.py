"""COLMAP sparse models in text format, for COLMAP, Gaussian splatting and other readers.

Camera and pixels are those of the original images if COLMAP has the lens model (pinhole, opencv, fisheye),
and those of the undistorted image for Tsai's, which it does not have. If the focal length changes, each image
has a camera of its own. COLMAP's pixel centres are at a half, OpenCV's at whole numbers. The world is that of
the run, ENU in metres, with its origin in ``origin.json``.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vgps.camera import distort
from vgps.crs import ELLIPSOIDAL
from vgps.model import Camera, FloatArray, IntArray
from vgps.solution import Solution
from vgps.writers.tum import quaternion

MARK = "origin.json"  # the file that marks a model written by vgps
FILES = ("cameras.txt", "images.txt", "points3D.txt", MARK)
# as ``ffmpeg -i video.mp4 -fps_mode passthrough -start_number 0 frame_%06d.jpg`` names the frames
IMAGE_NAME = "frame_{:06d}.jpg"
_CENTRE = 0.5


def write_colmap(solution: Solution, folder: Path, names: Sequence[str]) -> None:
    """Write cameras, images and points with their tracks, and the origin.

    Args:
        solution: A run.
        folder: An empty folder.
        names: Names of the images, one per frame.
    """
    observed = solution.observations
    uv = observed.uv_px if solution.camera.model == "tsai" else distort(solution.camera, observed.uv_px)
    uv = _in_pictures(solution, uv)
    good = np.flatnonzero(np.isfinite(uv).all(axis=1))
    order = good[np.argsort(observed.frame[good], kind="stable")]
    frame, landmark, uv = observed.frame[order], observed.landmark[order], uv[order]
    begins: IntArray = np.searchsorted(frame, np.arange(len(solution.t_s) + 1)).astype(np.int64)
    place = (
        np.arange(len(frame), dtype=np.int64) - begins[frame]
    )  # of an observation among those of its image
    cameras = frame_cameras(solution)
    _write(folder / "cameras.txt", [_camera_line(k, camera) for k, camera in enumerate(cameras, start=1)])
    _write(folder / "images.txt", _image_lines(solution, names, landmark, uv, begins))
    _write(folder / "points3D.txt", _point_lines(solution, frame, landmark, place, _errors(solution)[order]))
    origin = None if solution.world_origin is None else solution.world_origin._asdict()
    about = {
        "world_origin": origin,
        "height_datum": ELLIPSOIDAL,
        "axes": "east, north, up",
        "georeferenced": solution.georeferenced,
    }
    (folder / MARK).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def colmap_camera(camera: Camera) -> tuple[str, list[float]]:
    """Return COLMAP's model name and parameters of a camera."""
    pinhole = [camera.fx, camera.fy, camera.cx + _CENTRE, camera.cy + _CENTRE]
    k = list(camera.distortion)
    if camera.model == "fisheye":
        return "OPENCV_FISHEYE", [*pinhole, *k]
    if camera.model == "opencv" and any(k[4:]):
        return "FULL_OPENCV", [*pinhole, *k, *[0.0] * (8 - len(k))]
    if camera.model == "opencv":
        return "OPENCV", [*pinhole, *k[:4]]
    return "PINHOLE", pinhole


def frame_cameras(solution: Solution) -> list[Camera]:
    """Return the camera of the original images; one for each frame if its focal length changes."""
    camera, changes = solution.camera, solution.camera.focal_changes
    if changes is None:
        return [camera]
    u, v = changes.centre_px
    return [
        replace(
            camera,
            fx=ratio * camera.fx,
            fy=ratio * camera.fy,
            cx=u + ratio * (camera.cx - u),
            cy=v + ratio * (camera.cy - v),
            focal_changes=None,
        )
        for ratio in changes.ratio(solution.t_s).tolist()
    ]


def _in_pictures(solution: Solution, uv_px: FloatArray) -> FloatArray:
    """Return pixels (N, 2) of observations as the original images have them, whatever their focal length."""
    changes = solution.camera.focal_changes
    if changes is None:
        return uv_px
    ratio, centre = changes.ratio(solution.t_s[solution.observations.frame]), np.array(changes.centre_px)
    return np.asarray(centre + ratio[:, None] * (uv_px - centre))


def _camera_line(number: int, camera: Camera) -> str:
    name, parameters = colmap_camera(camera)
    return f"{number} {name} {camera.width} {camera.height} " + " ".join(f"{x:.17g}" for x in parameters)


def _image_lines(
    solution: Solution, names: Sequence[str], landmark: IntArray, uv: FloatArray, begins: IntArray
) -> Iterable[str]:
    camera_T_world: FloatArray = np.linalg.inv(solution.world_T_camera).astype(np.float64)
    quaternions, changing = quaternion(camera_T_world), solution.camera.focal_changes is not None
    for f, (q, t) in enumerate(zip(quaternions, camera_T_world[:, :3, 3], strict=True)):
        numbers = " ".join(f"{x:.17g}" for x in (q[3], *q[:3], *t))
        yield f"{f + 1} {numbers} {f + 1 if changing else 1} {names[f]}"
        rows = range(int(begins[f]), int(begins[f + 1]))
        yield " ".join(
            f"{uv[row, 0] + _CENTRE:.6f} {uv[row, 1] + _CENTRE:.6f} {int(landmark[row]) + 1}" for row in rows
        )


def _point_lines(
    solution: Solution, frame: IntArray, landmark: IntArray, place: IntArray, error_px: FloatArray
) -> Iterable[str]:
    points, gray = solution.landmarks.world_p_landmark, solution.landmarks.gray
    by_point = np.argsort(landmark, kind="stable")
    begins = np.searchsorted(landmark[by_point], np.arange(len(points) + 1))
    for j, (point, shade) in enumerate(zip(points, gray.tolist(), strict=True)):
        rows = by_point[begins[j] : begins[j + 1]]
        if len(rows) == 0:
            continue
        track = " ".join(f"{frame[row] + 1} {place[row]}" for row in rows.tolist())
        where = " ".join(f"{x:.17g}" for x in point)
        yield f"{j + 1} {where} {shade} {shade} {shade} {error_px[rows].mean():.6f} {track}"


def _errors(solution: Solution) -> FloatArray:
    """Return (N,) reprojection errors in the undistorted image, pixels."""
    observed, camera = solution.observations, solution.camera
    pose = solution.world_T_camera[observed.frame]
    offset = solution.landmarks.world_p_landmark[observed.landmark] - pose[:, :3, 3]
    p = (offset[:, None, :] @ pose[:, :3, :3])[:, 0]
    depth = np.where(p[:, 2] > 0.0, p[:, 2], np.nan)
    uv = p[:, :2] / depth[:, None] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    return np.asarray(np.linalg.norm(uv - observed.uv_px, axis=1))


def _write(file: Path, lines: Iterable[str]) -> None:
    with file.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(line + "\n" for line in lines)
