"""Warnings of localization: missing sensors and lost frames."""

import numpy as np

from vgps.config import LocalizationConfig
from vgps.model import BoolArray, FloatArray, Recording

_MAX_LISTED = 5  # intervals of lost frames
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
        found.append(f"no gyro: {_NO_GYRO}; add gyro.csv")
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
