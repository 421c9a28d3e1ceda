"""COLMAP's text models and lens models, from their documentation and independent of vgps.

Files: https://colmap.github.io/format.html. Equations: COLMAP's ``src/colmap/sensor/models.h``.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

# number of focal lengths; number of coefficients (k1, k2, p1, p2, k3, k4, k5, k6); fisheye
LENSES = {
    "SIMPLE_PINHOLE": (1, 0, False),
    "PINHOLE": (2, 0, False),
    "SIMPLE_RADIAL": (1, 1, False),
    "RADIAL": (1, 2, False),
    "OPENCV": (2, 4, False),
    "FULL_OPENCV": (2, 8, False),
    "SIMPLE_RADIAL_FISHEYE": (1, 1, True),
    "RADIAL_FISHEYE": (1, 2, True),
    "OPENCV_FISHEYE": (2, 4, True),
}


def colmap_pixels(model: str, parameters: list[float], camera_p: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of (N, 3) points in the camera frame; the first pixel's centre is at a half."""
    focals, coefficients, fisheye = LENSES[model]
    focal, centre = np.array(parameters[:focals]), np.array(parameters[focals : focals + 2])
    k = np.zeros(8)
    k[:coefficients] = parameters[focals + 2 :]
    uv = camera_p[:, :2] / camera_p[:, 2:]
    u, v = uv.T
    r2 = u * u + v * v
    if fisheye:
        r = np.sqrt(r2)
        theta = np.arctan(r)
        radial = theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)
        return focal * uv * np.where(r > 1e-9, radial / np.maximum(r, 1e-9), 1.0)[:, None] + centre
    radial = (1 + k[0] * r2 + k[1] * r2**2 + k[4] * r2**3) / (1 + k[5] * r2 + k[6] * r2**2 + k[7] * r2**3)
    tangential = [2 * k[2] * u * v + k[3] * (r2 + 2 * u * u), 2 * k[3] * u * v + k[2] * (r2 + 2 * v * v)]
    return focal * (uv * radial[:, None] + np.transpose(tangential)) + centre


@dataclass(frozen=True)
class Image:
    """A row of images.txt: its camera, the world's pose in it, observations and the points they show."""

    name: str
    camera: int
    camera_T_world: np.ndarray
    uv_px: np.ndarray
    point: np.ndarray


class ColmapModel:
    """A model read from cameras.txt, images.txt and points3D.txt."""

    def __init__(self, folder: Path) -> None:
        cameras = [line.split() for line in (folder / "cameras.txt").read_text().splitlines()]
        self.cameras = {int(cells[0]): (cells[1], [float(cell) for cell in cells[4:]]) for cells in cameras}
        lines = (folder / "images.txt").read_text().splitlines()
        self.images = {int(a.split()[0]): _image(a, b) for a, b in zip(lines[::2], lines[1::2], strict=True)}
        rows = [line.split() for line in (folder / "points3D.txt").read_text().splitlines()]
        self.points = {int(row[0]): np.array(row[1:4], float) for row in rows}
        self.errors_px = {int(row[0]): float(row[7]) for row in rows}
        self.tracks = {int(row[0]): np.array(row[8:], int).reshape(-1, 2).tolist() for row in rows}

    def reprojection_errors(self) -> np.ndarray:
        """(N,) distances between the observations and where the camera model puts their points, pixels."""
        errors = []
        for image in self.images.values():
            points = np.array([self.points[number] for number in image.point])
            camera_p = points @ image.camera_T_world[:3, :3].T + image.camera_T_world[:3, 3]
            errors.append(image.uv_px - colmap_pixels(*self.cameras[image.camera], camera_p))
        return np.linalg.norm(np.concatenate(errors), axis=1)


def _image(header: str, observations: str) -> Image:
    _, qw, qx, qy, qz, x, y, z, camera, name = header.split()
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat([float(q) for q in (qx, qy, qz, qw)]).as_matrix()
    pose[:3, 3] = [float(t) for t in (x, y, z)]
    rows = np.array(observations.split(), float).reshape(-1, 3)
    return Image(name, int(camera), pose, rows[:, :2], rows[:, 2].astype(int))
