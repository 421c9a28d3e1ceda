"""From a recording to a calibrated gyro, or to what in the motion is missing."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import Config, GyroCalibrationConfig
from vgps.errors import GeometryError, GyroLogError, RecordingError
from vgps.geometry.angular_rates import GyroIntegral
from vgps.gyro_calibration.checks import check_axes, check_motion
from vgps.gyro_calibration.coarse import Alignment, Guess, align_rates, guess_offset
from vgps.gyro_calibration.fit import Fit, Mount, fit_mount
from vgps.model import FloatArray, GyroLog, Recording
from vgps.runtime.progress import NoProgress, Progress
from vgps.runtime.threads import one_blas_thread
from vgps.tracking.relative_rotation import RelativeRotations, frame_rotations


@dataclass(frozen=True, kw_only=True)
class GyroCalibration:
    """How a gyro sits on a camera and how it errs, and how well that is known.

    Attributes:
        mount: Rotation, offset to add to the gyro's times, bias.
        rotation_sigma_rad: (3,) about the camera's axes.
        time_offset_sigma_s: Of the offset.
        bias_sigma_rad_s: (3,) gyro's axes.
        offset_known, bias_known: Whether the motion showed them well enough.
        intervals, missed: Between frames, used and without a rotation from the image.
        interval_s: Median length of an interval.
        turn_rad: (3,) the camera's turn over an interval, root mean square about its axes.
        residual_rad: (3,) gyro's turn less the camera's over an interval, root mean square about its axes.
        agreement: Correlation of the rates of gyro and video.
        scale: The video's turns over the gyro's; not 1 where the focal length is wrong.
        notes: What should be known before this is used.
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
    turn_rad: FloatArray
    residual_rad: FloatArray
    agreement: float
    scale: float
    notes: tuple[str, ...]

    def rig_fields(self) -> dict[str, Any]:
        """The keys of rig.yaml that this sets; those that the motion does not show are left out."""
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
    """Find gyro_R_camera, the offset between the clocks and the bias from the video and the gyro.

    What the rig says of them is not used. A rolling shutter is not modelled: the offset found is to the time
    of the picture's middle rows, and what turning fast does to the rest is in the residuals.

    Raises:
        RecordingError: There is no gyro.
        GyroLogError: Its times are not the video's, or it does not tell of the same motion.
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
        least = config.gyro_calibration.min_interval_s
        turns = frame_rotations(frames, recording.camera, config.tracking, rng, min_interval_s=least)
        return calibrate_from_turns(turns, raw, config.gyro_calibration)


def calibrate_from_turns(
    turns: RelativeRotations, gyro: GyroLog, config: GyroCalibrationConfig
) -> GyroCalibration:
    """The same from the camera's turns.

    Raises:
        GyroLogError, GeometryError: As `calibrate_gyro`.
    """
    if len(turns) < config.min_intervals:
        found = f"{len(turns)} intervals with a rotation from the image, {turns.missed} without"
        raise GeometryError(found, expected=f"at least {config.min_intervals}", remedy="give a longer video")
    integral = GyroIntegral(gyro)
    rates = _rates(turns)
    guess = guess_offset(turns, rates, integral, config)
    if guess is None:
        raise GyroLogError(
            f"runs from {gyro.t_s[0]:.2f} to {gyro.t_s[-1]:.2f} s, the video from {turns.start_s[0]:.2f} to "
            f"{turns.end_s[-1]:.2f} s",
            file=gyro.source,
            expected=f"the same time to {config.search_s:g} s",
            remedy="check video_start_s in rig.yaml",
        )
    turns, rates = _covered(turns, rates, integral, guess.time_offset_s)
    check_motion(_gyro_rates(turns, integral, guess.time_offset_s), rates, guess, gyro, config)
    start = Mount(guess.alignment.gyro_R_camera, guess.time_offset_s, np.zeros(3))
    fit = fit_mount(turns, integral, start, config.robust_sigmas)
    by_gyro = _gyro_rates(turns, integral, fit.mount.time_offset_s)
    alignment = align_rates(by_gyro, rates, fit.weight)
    check_axes(fit, alignment, turns, config)
    return _told(turns, fit, guess, alignment, _scale(by_gyro, rates, fit), config)


def _rates(turns: RelativeRotations) -> FloatArray:
    vectors = Rotation.from_matrix(turns.start_R_end).as_rotvec()
    return np.asarray(vectors / (turns.end_s - turns.start_s)[:, None])


def _gyro_rates(turns: RelativeRotations, gyro: GyroIntegral, offset_s: float) -> FloatArray:
    return gyro.mean_rates(turns.start_s - offset_s, turns.end_s - offset_s)


def _covered(
    turns: RelativeRotations, rates: FloatArray, gyro: GyroIntegral, offset_s: float
) -> tuple[RelativeRotations, FloatArray]:
    """Without the intervals for which the gyro, moved by up to an interval, has no rates."""
    length = turns.end_s - turns.start_s
    start, end = turns.start_s - offset_s - length, turns.end_s - offset_s + length
    kept = gyro.covers(start, end)
    return turns.only(kept), rates[kept]


def _scale(by_gyro: FloatArray, rates: FloatArray, fit: Fit) -> float:
    """The camera's turns over the gyro's."""
    rotated = (by_gyro - fit.mount.bias_rad_s) @ fit.mount.gyro_R_camera
    return float(fit.weight @ np.sum(rotated * rates, axis=1) / (fit.weight @ np.sum(rotated**2, axis=1)))


def _told(
    turns: RelativeRotations,
    fit: Fit,
    guess: Guess,
    alignment: Alignment,
    scale: float,
    config: GyroCalibrationConfig,
) -> GyroCalibration:
    sigma = np.sqrt(np.diag(fit.covariance))
    notes = []
    twin = 1 - guess.runner_up < config.ambiguity_ratio * (1 - guess.alignment.agreement)
    offset_known = bool(sigma[3] < config.max_offset_sigma_s) and not twin
    bias_known = bool(np.degrees(sigma[4:]).max() < config.max_bias_sigma_deg_s)
    if twin:
        notes.append(
            f"the motion repeats itself: offsets of {guess.time_offset_s:.3f} and {guess.runner_up_s:.3f} s "
            "agree alike; neither is written"
        )
    elif not offset_known:
        notes.append(f"the offset of the clocks is known to {sigma[3]:.4f} s only; not written")
    if not bias_known:
        notes.append(f"the bias is known to {np.degrees(sigma[4:]).max():.2f} deg/s only; not written")
    if abs(scale - 1) > config.scale_tolerance:
        notes.append(
            f"the video turns {scale:.3f} times as far as the gyro: check the focal length in camera.yaml"
        )
    turned = Rotation.from_matrix(turns.start_R_end).as_rotvec()
    return GyroCalibration(
        mount=fit.mount,
        rotation_sigma_rad=sigma[:3],
        time_offset_sigma_s=float(sigma[3]),
        bias_sigma_rad_s=sigma[4:],
        offset_known=offset_known,
        bias_known=bias_known,
        intervals=len(turns),
        missed=turns.missed,
        interval_s=float(np.median(turns.end_s - turns.start_s)),
        turn_rad=np.sqrt(np.mean(turned**2, axis=0)),
        residual_rad=np.sqrt(np.average(fit.residual_rad**2, axis=0, weights=fit.weight)),
        agreement=alignment.agreement,
        scale=scale,
        notes=tuple(notes),
    )
