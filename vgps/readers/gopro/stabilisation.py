"""A GoPro's inertial sensors beside a stabilised picture, which does not turn as the camera's body does.

The header says whether stabilisation was on (EISE), the streams CORI and IORI how body and picture turned.
On a walk with a HERO7 the body turned at 15 to 21 degrees a second (rms about each axis), the picture at 3;
above 1 Hz they correlate to 0.32 at most, within 0.6 s: without the streams the gyro says nothing of it.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vgps.model import GyroLog, ImuLog, ImuMount, Recording
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.gopro.lens import gopro_settings
from vgps.readers.gopro.sensors import PictureRotations, picture_rotations, picture_turn_rad

_STILL_RAD = np.radians(0.5)  # a picture that turns by less on the body is not stabilised
_MIN_SAMPLES = 2


def with_picture_motion(recording: Recording, telemetry: Telemetry) -> Recording:
    """Return a recording whose inertial sensors turn as the picture does.

    Beside a stabilised picture its own rotations stand in for a GoPro's gyro, and the accelerometer is turned
    with it; both are left out if the file does not have them. Logs from other files stay as they are.
    """
    gyro = recording.gyro if _is_own(recording.gyro, telemetry) else None
    imu = recording.imu if _is_own(recording.imu, telemetry) else None
    if (gyro is None and imu is None) or not is_stabilised(telemetry):
        return recording
    rotations = picture_rotations(telemetry)
    if rotations is None:
        note = "the picture is stabilised and the file does not say how it turned: the camera's own gyro"
        return replace(
            recording,
            imu=None if imu is not None else recording.imu,
            gyro=None if gyro is not None else recording.gyro,
            notes=(*recording.notes, f"{note} and accelerometer, which turn otherwise, are left out"),
        )
    note = "the picture is stabilised: its rotations (CORI, IORI) stand in for the camera's gyro"
    turned = ", and the accelerometer is turned with it" if imu is not None else ""
    recording = replace(recording, notes=(*recording.notes, note + turned))
    rates = _rates(rotations, telemetry)
    if imu is not None and recording.rig.imu is not None:
        log = _with_picture(imu, recording.rig.imu, rotations, rates)
        rig = replace(recording.rig, imu=_turned(recording.rig.imu))
        recording = replace(recording, imu=log, rig=rig)
    if gyro is None:
        return recording
    return replace(recording, gyro=rates, rig=replace(recording.rig, gyro_R_camera=np.eye(3)))


def is_stabilised(telemetry: Telemetry) -> bool:
    """Whether a GoPro turned the picture on its body, by its header or by what it recorded."""
    turn_rad = picture_turn_rad(telemetry)
    if turn_rad is not None:
        return bool(turn_rad > _STILL_RAD)
    entry = gopro_settings(telemetry.path).get("EISE")
    return entry is not None and entry.data.strip(b"\0 ") == b"Y"


def _is_own(log: GyroLog | ImuLog | None, telemetry: Telemetry) -> bool:
    return log is not None and log.source == telemetry.path


def _with_picture(imu: ImuLog, mount: ImuMount, rotations: PictureRotations, rates: GyroLog) -> ImuLog | None:
    """Return the samples in the image's axes: the image's mean rates from frame to frame, and the specific
    force turned as the image is; None if too few lie between frames."""
    frames_s = rotations.t_s
    inside = (imu.t_s >= frames_s[0]) & (imu.t_s < frames_s[-1])
    if inside.sum() < _MIN_SAMPLES:
        return None
    t_s = imu.t_s[inside]
    camera_R_body = Slerp(frames_s, Rotation.from_matrix(rotations.camera_R_body))(t_s)
    return replace(
        imu,
        t_s=t_s,
        rate_rad_s=rates.rate_rad_s[np.searchsorted(frames_s, t_s, side="right") - 1],
        force_m_s2=np.asarray(camera_R_body.apply(imu.force_m_s2[inside] @ mount.imu_R_camera)),
        saturated=imu.saturated[inside],
    )


def _turned(mount: ImuMount) -> ImuMount:
    """Return the mount of an IMU whose samples were turned to the axes of the image."""
    R = mount.imu_R_camera
    return replace(
        mount,
        imu_R_camera=np.eye(3),
        imu_p_camera=mount.imu_p_camera @ R,
        accelerometer_bias_m_s2=mount.accelerometer_bias_m_s2 @ R,
        gyro_bias_rad_s=np.zeros(3),
    )


def _rates(rotations: PictureRotations, telemetry: Telemetry) -> GyroLog:
    """Return the mean rates from each sample to the next, about the camera's axes."""
    t_s, rotation = rotations.t_s, Rotation.from_matrix(rotations.first_R_camera)
    turned = (rotation[:-1].inv() * rotation[1:]).as_rotvec()
    rates = turned / np.diff(t_s)[:, None]
    return GyroLog(0.5 * (t_s[1:] + t_s[:-1]), np.asarray(rates, np.float64), telemetry.path)
