"""Gyro calibration from a recording; errors say what the motion does not show."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import Config, GyroCalibrationConfig
from vgps.errors import GeometryError, GyroLogError, RecordingError
from vgps.geometry.angular_rates import GyroIntegral, RelativeRotations
from vgps.gyro_calibration.checks import check_axes, check_motion
from vgps.gyro_calibration.coarse import Alignment, Guess, align_rates, guess_offset
from vgps.imu.mount_fit import Fit, Mount, fit_mount
from vgps.model import FloatArray, GyroLog, Recording
from vgps.runtime.progress import NoProgress, Progress
from vgps.runtime.threads import one_blas_thread
from vgps.tracking.relative_rotation import frame_rotations


@dataclass(frozen=True, kw_only=True)
class GyroCalibration:
    """Rotation, clock offset and bias of a gyro, with their uncertainties.

    Attributes:
        mount: Rotation, offset to add to the gyro's times, bias.
        rotation_sigma_rad: (3,) about the camera's axes.
        time_offset_sigma_s: Of the offset.
        bias_sigma_rad_s: (3,) gyro's axes.
        offset_known, bias_known: Whether the motion shows them well enough.
        intervals, missed: Numbers of intervals between frames: used, and without a rotation from the image.
        interval_s: Median length of an interval.
        rotation_rms_rad: (3,) RMS rotation of the camera over an interval, about its axes.
        residual_rad: (3,) RMS difference of gyro and camera over an interval, about the camera's axes.
        agreement: Correlation of the rates of gyro and video.
        scale: Ratio of the video's rotations to the gyro's; not 1 if the focal length is wrong.
        notes: What to know before using the result.
    """

    mount: Mount
    rotation_sigma_rad: FloatArray
    time_offset_sigma_s: float
    bias_sigma_rad_s: FloatArray
    offset_known: bool
    bias_known: bool
    intervals: int
    missed: int
    interval_s: float
    rotation_rms_rad: FloatArray
    residual_rad: FloatArray
    agreement: float
    scale: float
    notes: tuple[str, ...]

    def rig_fields(self) -> dict[str, Any]:
        """Return the keys for rig.yaml, without those that the motion does not show."""
        fields: dict[str, Any] = {
            "gyro_R_camera": self.mount.gyro_R_camera.round(9).tolist(),
            "gyro_rotation_sigma_deg": np.degrees(self.rotation_sigma_rad).round(4).tolist(),
        }
        if self.offset_known:
            fields["gyro_time_offset_s"] = round(self.mount.time_offset_s, 6)
            fields["gyro_time_offset_sigma_s"] = round(self.time_offset_sigma_s, 6)
        if self.bias_known:
            fields["gyro_bias_rad_s"] = self.mount.bias_rad_s.round(6).tolist()
            fields["gyro_bias_sigma_rad_s"] = self.bias_sigma_rad_s.round(6).tolist()
        return fields


def calibrate_gyro(
    recording: Recording, config: Config | None = None, progress: Progress | None = None
) -> GyroCalibration:
    """Estimate gyro_R_camera, the clock offset and the bias from the video and the gyro.

    Values in the rig are ignored. A rolling shutter is not modelled: the offset refers to the time of the
    image's middle rows, and the effect of fast rotations on other rows remains in the residuals.

    Raises:
        RecordingError: There is no gyro.
        GyroLogError: Its times are not the video's, or it recorded another motion.
        GeometryError: The motion does not show the rotation of the sensor.
    """
    config, progress = config or Config(), progress or NoProgress()
    if recording.gyro is None:
        raise RecordingError("no gyro", file=recording.path, remedy="add gyro.csv (t_s, wx_rad_s, ...)")
    video, rig = recording.video, recording.rig
    raw = replace(
        recording.gyro,
        t_s=recording.gyro.t_s - rig.gyro_time_offset_s,
        rate_rad_s=recording.gyro.rate_rad_s + rig.gyro_bias_rad_s,
    )
    progress.stage("rotations from frame to frame")
    frames = progress.track(video.frames(), len(video.times_s))
    rng = np.random.default_rng(config.seed)
    with one_blas_thread():
        settings = config.gyro_calibration
        rotations = frame_rotations(
            frames,
            recording.camera,
            config.tracking,
            rng,
            settings.rotation,
            min_interval_s=settings.min_interval_s,
        )
        return calibrate_from_rotations(rotations, raw, config.gyro_calibration)


def calibrate_from_rotations(
    rotations: RelativeRotations, gyro: GyroLog, config: GyroCalibrationConfig
) -> GyroCalibration:
    """Calibrate from the camera's relative rotations, see `calibrate_gyro`.

    Raises:
        GyroLogError, GeometryError: As `calibrate_gyro`.
    """
    if len(rotations) < config.min_intervals:
        found = f"{len(rotations)} intervals have a rotation from the image, {rotations.missed} have none"
        raise GeometryError(found, expected=f"at least {config.min_intervals}", remedy="give a longer video")
    integral = GyroIntegral(gyro)
    rates = rotations.mean_rates()
    guess = guess_offset(rotations, rates, integral, config)
    if guess is None:
        raise GyroLogError(
            f"runs from {gyro.t_s[0]:.2f} to {gyro.t_s[-1]:.2f} s, the video from "
            f"{rotations.start_s[0]:.2f} to {rotations.end_s[-1]:.2f} s",
            file=gyro.source,
            expected=f"the same times within {config.search_s:g} s",
            remedy="check video_start_s in rig.yaml",
        )
    rotations, rates = _covered(rotations, rates, integral, guess.time_offset_s)
    check_motion(_gyro_rates(rotations, integral, guess.time_offset_s), rates, guess, gyro, config)
    start = Mount(guess.alignment.gyro_R_camera, guess.time_offset_s, np.zeros(3))
    fit = fit_mount(rotations, integral, start, config.robust_sigmas)
    by_gyro = _gyro_rates(rotations, integral, fit.mount.time_offset_s)
    alignment = align_rates(by_gyro, rates, fit.weight)
    check_axes(fit, alignment, rotations, config)
    return _result(rotations, fit, guess, alignment, _scale(by_gyro, rates, fit), config)


def _gyro_rates(rotations: RelativeRotations, gyro: GyroIntegral, offset_s: float) -> FloatArray:
    return gyro.mean_rates(rotations.start_s - offset_s, rotations.end_s - offset_s)


def _covered(
    rotations: RelativeRotations, rates: FloatArray, gyro: GyroIntegral, offset_s: float
) -> tuple[RelativeRotations, FloatArray]:
    """Return the intervals for which the gyro, shifted by up to an interval, has rates."""
    length = rotations.end_s - rotations.start_s
    start, end = rotations.start_s - offset_s - length, rotations.end_s - offset_s + length
    kept = gyro.covers(start, end)
    return rotations.where(kept), rates[kept]


def _scale(by_gyro: FloatArray, rates: FloatArray, fit: Fit) -> float:
    """Return the ratio of the camera's rotations to the gyro's."""
    rotated = (by_gyro - fit.mount.bias_rad_s) @ fit.mount.gyro_R_camera
    return float(fit.weight @ np.sum(rotated * rates, axis=1) / (fit.weight @ np.sum(rotated**2, axis=1)))


def _result(
    rotations: RelativeRotations,
    fit: Fit,
    guess: Guess,
    alignment: Alignment,
    scale: float,
    config: GyroCalibrationConfig,
) -> GyroCalibration:
    sigma = np.sqrt(np.diag(fit.covariance))
    ambiguous = 1 - guess.runner_up < config.ambiguity_ratio * (1 - guess.alignment.agreement)
    result = GyroCalibration(
        mount=fit.mount,
        rotation_sigma_rad=sigma[:3],
        time_offset_sigma_s=float(sigma[3]),
        bias_sigma_rad_s=sigma[4:],
        offset_known=bool(sigma[3] < config.max_offset_sigma_s) and not ambiguous,
        bias_known=bool(np.degrees(sigma[4:]).max() < config.max_bias_sigma_deg_s),
        intervals=len(rotations),
        missed=rotations.missed,
        interval_s=float(np.median(rotations.end_s - rotations.start_s)),
        rotation_rms_rad=np.sqrt(
            np.mean(Rotation.from_matrix(rotations.start_R_end).as_rotvec() ** 2, axis=0)
        ),
        residual_rad=np.sqrt(np.average(fit.residual_rad**2, axis=0, weights=fit.weight)),
        agreement=alignment.agreement,
        scale=scale,
        notes=(),
    )
    return replace(result, notes=_notes(result, guess, ambiguous, config.scale_tolerance))


def _notes(result: GyroCalibration, guess: Guess, ambiguous: bool, scale_tolerance: float) -> tuple[str, ...]:
    notes = []
    if ambiguous:
        notes.append(
            f"the motion repeats itself: clock offsets of {guess.time_offset_s:.3f} and "
            f"{guess.runner_up_s:.3f} s fit equally well; neither is written"
        )
    elif not result.offset_known:
        notes.append(f"the clock offset is only known to {result.time_offset_sigma_s:.4f} s; not written")
    if not result.bias_known:
        sigma_deg_s = np.degrees(result.bias_sigma_rad_s).max()
        notes.append(f"the bias is only known to {sigma_deg_s:.2f} deg/s; not written")
    if abs(result.scale - 1) > scale_tolerance:
        notes.append(
            f"the video rotates {result.scale:.3f} times as far as the gyro: check the focal length in "
            "camera.yaml"
        )
    return tuple(notes)
