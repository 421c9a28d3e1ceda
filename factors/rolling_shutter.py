"""Projection factors of a rolling shutter: each observation at its own row's time on the continuous path."""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from factors.continuous_path import (
    FloatArray,
    path_poses,
    path_vectors,
    path_weights,
    rotation_jacobians,
    vector_jacobians,
)
from factors.custom import POINT3, POSE3, VECTOR1, Linearisation, Variable, custom_factor


@dataclass(frozen=True)
class RowTime:
    """The time of a row on the path.

    Attributes:
        knot_s: (k,) times of the frames through which the path is drawn, ascending; 2 to 4 of them.
        frame_s: Time of the frame that was observed, that of its middle row.
        share: Place of the row, from -1/2 (first) to 1/2 (last).
    """

    knot_s: FloatArray
    frame_s: float
    share: float


def rolling_projection_factor(
    pose_keys: Sequence[int],
    point_key: int,
    uv_px: FloatArray,
    row: RowTime,
    camera: gtsam.Cal3_S2 | gtsam.PinholeCameraCal3_S2,
    noise: gtsam.noiseModel.Base,
    readout: int | float,
) -> gtsam.CustomFactor:
    """Return a factor for an observation of a landmark by a row of a rolling shutter.

    Residual (2,): projection minus ``uv_px``. Jacobians: (2, 6) to each pose, (2, 3) to the landmark and,
    if the readout is a variable, (2, 1) to it. A landmark behind the camera has the constant
    residual ``2 fx``.

    Args:
        pose_keys: Keys of the poses of the knots.
        point_key: Key of the landmark.
        uv_px: (2,) observed position in the undistorted image.
        row: Time of the row.
        camera: The pinhole camera's calibration; or with its pose on a rig, of which the poses are.
        noise: Of dimension 2, pixels.
        readout: Time from the first row to the last, seconds, or the key (an ``int``) of a vector (1,) of it.
    """
    uv = np.array(uv_px, dtype=np.float64)
    estimated = isinstance(readout, int)
    knot_s = np.asarray(row.knot_s, dtype=np.float64)[None]
    if isinstance(camera, gtsam.Cal3_S2):
        camera = gtsam.PinholeCameraCal3_S2(gtsam.Pose3(), camera)
    calibration, mount = camera.calibration(), camera.pose().matrix()

    def error(*values: object) -> Linearisation:
        poses = np.stack([pose.matrix() for pose in values[: len(pose_keys)]])  # type: ignore[attr-defined]
        point = np.asarray(values[len(pose_keys)], dtype=np.float64)
        readout_s = float(np.asarray(values[-1])[0]) if estimated else float(readout)
        weights, rates = path_weights(knot_s, np.array([row.frame_s + row.share * readout_s]))
        vectors = path_vectors(poses)
        residual, by_vector, by_point = _project(weights[0] @ vectors, point, calibration, mount)
        jacobians = [w * by_vector @ E for w, E in zip(weights[0], vector_jacobians(vectors), strict=True)]
        jacobians.append(by_point)
        if estimated:
            jacobians.append((row.share * by_vector @ (rates[0] @ vectors))[:, None])
        return residual - uv if by_point.any() else residual, jacobians

    variables = [*(Variable(key, POSE3) for key in pose_keys), Variable(point_key, POINT3)]
    if isinstance(readout, int):
        variables.append(Variable(readout, VECTOR1))
    return custom_factor(noise, variables, error)


def _project(
    vector: FloatArray, point: FloatArray, calibration: gtsam.Cal3_S2, mount: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return pixels (2,) and their derivatives by the path's vector (2, 7) and by the point (2, 3).

    Behind the camera the pixels are ``2 fx`` and the derivatives zero.
    """
    fx, fy = calibration.fx(), calibration.fy()
    pose = path_poses(vector[None])[0]
    p = pose[:3, :3].T @ (point - pose[:3, 3])
    x, y, depth = mount[:3, :3].T @ (p - mount[:3, 3])
    if depth <= 0.0:
        return np.full(2, 2.0 * fx), np.zeros((2, 7)), np.zeros((2, 3))
    by_camera_p = np.array([[fx, 0.0, -fx * x / depth], [0.0, fy, -fy * y / depth]]) / depth
    by_p = by_camera_p @ mount[:3, :3].T
    by_rotation = by_p @ np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])
    by_point = by_p @ pose[:3, :3].T
    by_vector = np.hstack([by_rotation @ rotation_jacobians(vector[None, :4])[0], -by_point])
    return (
        np.array([fx * x / depth + calibration.px(), fy * y / depth + calibration.py()]),
        by_vector,
        by_point,
    )
