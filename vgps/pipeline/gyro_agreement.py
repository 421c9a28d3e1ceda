"""The rotations of a path against those of its gyro, which show whether the focal length is right.

A focal length that is too long by a share makes rotations about the image's axes too small by that share.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry.angular_rates import GyroIntegral
from vgps.model import FloatArray, Recording
from vgps.solution import Solution

_SPAN_S = 0.5  # of a rotation: long against the noise of poses and clocks, short against a gyro's drift
_MIN_RMS_RAD = np.radians(0.5)  # smaller rotations say nothing
_MIN_CORRELATION = 0.98
_LEAST_SIGMA = 0.005  # of a gyro's scale
_WORTH_A_NOTE = 0.05


@dataclass(frozen=True)
class RotationRatio:
    """Rotations of the gyro over those of the video: above 1 if the focal length is too long; its sigma."""

    value: float
    sigma: float


def rotation_ratio(solution: Solution, recording: Recording) -> RotationRatio | None:
    """Compare rotations over half a second about the image's axes; None if they say nothing or disagree.

    A constant bias of the gyro is no part of the ratio.
    """
    gyro, gyro_R_camera = recording.gyro, recording.rig.gyro_R_camera
    if gyro is None or gyro_R_camera is None or len(gyro.t_s) < 2:
        return None
    integral, t_s = GyroIntegral(gyro), solution.t_s
    span = int(np.searchsorted(t_s, t_s[0] + _SPAN_S))
    first = np.arange(max(len(t_s) - span, 0))
    first = first[integral.covers(t_s[first], t_s[first + span])]
    if len(first) <= span:
        return None
    poses = Rotation.from_matrix(solution.world_T_camera[:, :3, :3])
    video = (poses[first].inv() * poses[first + span]).as_rotvec()[:, :2]
    turned = Rotation.from_matrix(integral.relative_rotations(t_s[first], t_s[first + span])).as_rotvec()
    sensor = (turned @ gyro_R_camera)[:, :2]
    return _ratio(sensor - sensor.mean(axis=0), video - video.mean(axis=0), len(first) / span)


def _ratio(sensor: FloatArray, video: FloatArray, independent: float) -> RotationRatio | None:
    a, b = sensor.ravel(), video.ravel()
    rms = float(np.sqrt(np.mean(b**2)))
    if rms < _MIN_RMS_RAD:
        return None
    correlation = float(a @ b / np.sqrt((a @ a) * (b @ b)))
    if correlation < _MIN_CORRELATION:
        return None
    value = float(a @ b / (b @ b))
    spread = float(np.std(a - value * b)) / rms / np.sqrt(independent)
    return RotationRatio(value, max(spread, _LEAST_SIGMA))


def with_gyro_focal(recording: Recording, solution: Solution) -> Recording:
    """Return an uncalibrated recording with the focal length that the gyro shows as its guess, if it does."""
    (guess,) = recording.guesses
    ratio = rotation_ratio(solution, recording)
    if ratio is None or ratio.sigma > guess.focal_sigma:
        return replace(recording, camera=solution.camera)
    focal = solution.camera.fx / ratio.value
    known = replace(
        guess,
        camera=replace(guess.camera, fx=focal, fy=focal),
        focal_sigma=ratio.sigma,
        source=f"{guess.source}; the focal length by the gyro",
    )
    return replace(recording, camera=replace(solution.camera, fx=focal, fy=focal), guesses=(known,))


def with_gyro_note(solution: Solution, recording: Recording) -> Solution:
    """Return a solution with a warning if the gyro shows that the focal length is wrong."""
    ratio = rotation_ratio(solution, recording)
    if ratio is None or abs(ratio.value - 1.0) < max(_WORTH_A_NOTE, 3.0 * ratio.sigma):
        return solution
    wrong, focal_px = "long" if ratio.value > 1.0 else "short", solution.camera.fx
    note = (
        f"the gyro turns {ratio.value:.2f} times as far as the video (sigma {ratio.sigma:.2f}): the focal "
        f"length of {focal_px:.0f} px is too {wrong}, {focal_px / ratio.value:.0f} px would agree: check "
        "camera.yaml, or leave it out"
    )
    return replace(solution, warnings=(*solution.warnings, note))
