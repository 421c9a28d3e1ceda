"""Warnings of localization: missing sensors, lost frames, and a camera too fast after a start."""

from collections.abc import Sequence
from math import ceil

import numpy as np

from vgps.config import LocalizationConfig
from vgps.localization.tracker import TrackedFrame
from vgps.model import BoolArray, FloatArray, Recording

_MAX_LISTED = 5  # intervals of lost frames
_MAX_CREDIBLE_M_S = 100.0  # a higher speed between two poses means that one of them is false
_NO_GYRO = (
    "rotation is predicted at constant angular velocity, windows are wider, quick rotations may lose track"
)


def sensor_warnings(recording: Recording, config: LocalizationConfig) -> tuple[str, ...]:
    """Return a warning for each sensor that is missing or incomplete, with its effect and remedy."""
    found = []
    rig, gyro = recording.rig, recording.gyro
    if not config.use_gyro:
        found.append(f"the gyro is not used (use_gyro: false): {_NO_GYRO}")
    elif gyro is None:
        found.append(f"no gyro: {_NO_GYRO}; add gyro.csv or imu.csv")
    elif rig.gyro_R_camera is None:
        found.append(
            f"no gyro_R_camera in rig.yaml, the gyro is not used: {_NO_GYRO}; run vgps calibrate-gyro"
        )
    elif not (gyro.t_s[0] <= recording.video.times_s[0] and gyro.t_s[-1] >= recording.video.times_s[-1]):
        found.append(
            f"the gyro covers {gyro.t_s[0]:.2f} to {gyro.t_s[-1]:.2f} s of a video from "
            f"{recording.video.times_s[0]:.2f} to {recording.video.times_s[-1]:.2f} s: elsewhere {_NO_GYRO}"
        )
    if config.blur != "none" and not rig.exposure_s:
        found.append(
            "no exposure_s in rig.yaml: templates are not blurred and match blurred frames less well; "
            "add the exposure time"
        )
    return tuple(found)


def loss_warnings(tracked: BoolArray, t_s: FloatArray) -> tuple[str, ...]:
    """Return a warning that lists the frames (F,) that were not tracked, if there are any."""
    lost = np.flatnonzero(~tracked)
    if len(lost) == 0:
        return ()
    begins = lost[np.diff(lost, prepend=-2) > 1]
    ends = lost[np.diff(lost, append=len(tracked) + 1) > 1]
    intervals = [
        f"{first} to {last} ({t_s[first]:.2f} to {t_s[last]:.2f} s)" if last > first else f"{first}"
        for first, last in zip(begins, ends, strict=True)
    ]
    more = f" and {len(intervals) - _MAX_LISTED} more intervals" if len(intervals) > _MAX_LISTED else ""
    return (
        f"{len(lost)} of {len(tracked)} frames show too few landmarks and are bridged: "
        f"{', '.join(intervals[:_MAX_LISTED])}{more}",
    )


def speed_warnings(
    frames: Sequence[TrackedFrame], focal_px: float, config: LocalizationConfig
) -> tuple[str, ...]:
    """Return a warning if the camera was lost right after a start, where its velocity is still unknown.

    The speed is that from the start to the next tracked frame. There is no warning if it is within
    ``max_speed_m_s``, as the frame was then lost for another reason.

    Args:
        frames: Every frame of the video.
        focal_px: Focal length.
        config: Settings.
    """
    tracked = [i for i, frame in enumerate(frames) if frame.tracked]
    fastest, window_px, count, undecided = 0.0, 0.0, 0, -1
    for before, start, after in zip([-1, *tracked], tracked, [*tracked[1:], -1], strict=False):
        t_s = frames[start].t_s
        known = before >= 0 and t_s - frames[before].t_s <= config.max_velocity_gap_s
        if not frames[start].recovered or known or start + 1 in (after, len(frames)):
            continue
        if after < 0:
            undecided = start + 1
            continue
        speed = _distance_m(frames[start], frames[after]) / (frames[after].t_s - t_s)
        if config.max_speed_m_s < speed <= _MAX_CREDIBLE_M_S:
            interval_s = frames[start + 1].t_s - t_s
            needed_px = focal_px * speed * interval_s / _median_depth_m(frames[start])
            fastest, window_px, count = max(fastest, speed), max(window_px, needed_px), count + 1
    if count or undecided >= 0:
        return (_speed_message(count, fastest, window_px, undecided, config),)
    return ()


def _speed_message(
    count: int, fastest: float, window_px: float, undecided: int, config: LocalizationConfig
) -> str:
    searched = f"where windows are for localization.max_speed_m_s = {config.max_speed_m_s:g} m/s"
    if count:
        remedy = f"localization.max_speed_m_s to {5 * ceil(fastest / 4)}"
        if window_px > config.max_window_px:
            remedy += f" and localization.max_window_px to {ceil(window_px)}"
        return (
            f"the camera was lost in the frame after {count} of its starts, {searched}, while it moved at "
            f"up to {fastest:.0f} m/s: set {remedy} with --config"
        )
    return (
        f"frame {undecided} was lost right after a start, {searched}: if the camera was faster, "
        "raise it with --config"
    )


def _distance_m(one: TrackedFrame, other: TrackedFrame) -> float:
    return float(np.linalg.norm(one.world_T_camera[:3, 3] - other.world_T_camera[:3, 3]))


def _median_depth_m(frame: TrackedFrame) -> float:
    pose = frame.world_T_camera
    return float(np.median((frame.observations.world_p_landmark - pose[:3, 3]) @ pose[:3, 2]))
