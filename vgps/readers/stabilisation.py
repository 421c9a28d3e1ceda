"""A GoPro's inertial sensors beside a stabilised picture, which does not turn as the camera's body does.

The header says whether stabilisation was on (EISE), the streams CORI and IORI how body and picture turned.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.model import FloatArray, GyroLog, ImuLog, Recording
from vgps.readers.gopro import picture_rotations, picture_turn_rad
from vgps.readers.gopro_lens import gopro_settings
from vgps.readers.gpmf import Telemetry

_STILL_RAD = np.radians(0.5)  # a picture that turns by less on the body is not stabilised


def with_picture_motion(recording: Recording, telemetry: Telemetry) -> Recording:
    """Return a recording whose inertial sensors turn as the picture does.

    Beside a stabilised picture its own rotations stand in for a GoPro's gyro, or the gyro is left out if the
    file does not have them; the accelerometer is left out. Logs from other files stay as they are.
    """
    gyro, imu = (log if _is_own(log, telemetry) else None for log in (recording.gyro, recording.imu))
    if (gyro is None and imu is None) or not is_stabilised(telemetry):
        return recording
    without_imu = recording if imu is None else replace(recording, imu=None)
    rotations = picture_rotations(telemetry)
    if rotations is None:
        note = "the picture is stabilised and the file does not say how it turned: the camera's own gyro"
        return replace(
            without_imu,
            gyro=None if gyro is not None else recording.gyro,
            notes=(*recording.notes, f"{note} and accelerometer, which turn otherwise, are left out"),
        )
    note = "the picture is stabilised: its rotations (CORI, IORI) stand in for the camera's gyro"
    left = ", and the accelerometer is left out" if imu is not None else ""
    t_s, first_R_camera = rotations
    rig = replace(recording.rig, gyro_R_camera=np.eye(3)) if gyro is not None else recording.rig
    return replace(
        without_imu,
        gyro=_rates(t_s, Rotation.from_matrix(first_R_camera), telemetry) if gyro else recording.gyro,
        rig=rig,
        notes=(*recording.notes, note + left),
    )


def is_stabilised(telemetry: Telemetry) -> bool:
    """Whether a GoPro turned the picture on its body, by its header or by what it recorded."""
    turn_rad = picture_turn_rad(telemetry)
    if turn_rad is not None:
        return bool(turn_rad > _STILL_RAD)
    entry = gopro_settings(telemetry.path).get("EISE")
    return entry is not None and entry.data.strip(b"\0 ") == b"Y"


def _is_own(log: GyroLog | ImuLog | None, telemetry: Telemetry) -> bool:
    return log is not None and log.source == telemetry.path


def _rates(t_s: FloatArray, rotation: Rotation, telemetry: Telemetry) -> GyroLog:
    """Return the mean rates from each sample to the next, about the camera's axes."""
    turned = (rotation[:-1].inv() * rotation[1:]).as_rotvec()
    rates = turned / np.diff(t_s)[:, None]
    return GyroLog(0.5 * (t_s[1:] + t_s[:-1]), np.asarray(rates, np.float64), telemetry.path)
