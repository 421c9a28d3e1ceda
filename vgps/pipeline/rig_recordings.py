"""The recording of one of a rig's other cameras, as stages A to C take it."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.errors import ConfigError
from vgps.model import ImuMount, Recording, Rig, RigCamera


def check_settings(config: Config) -> None:
    """Refuse settings that a rig of several cameras does not support.

    Raises:
        ConfigError: The calibrations are to be refined, or a readout is to be estimated.
    """
    settings = {
        "intrinsics.refine": config.intrinsics.refine,
        "rolling_shutter.estimate": config.rolling_shutter.estimate,
    }
    for key, value in settings.items():
        if value == "yes":
            raise ConfigError(
                "yes, with a rig of several cameras, whose lenses are held",
                place=f"key {key}",
                expected="auto or no",
                remedy="smooth each camera alone, and give the camera.yaml of its run",
            )


def settings_for(camera: RigCamera, config: Config) -> Config:
    """Return the settings under which another camera is tracked by itself.

    It is level only as far as its y axis points where that of the reference does.
    """
    tilt = float(np.degrees(np.arccos(np.clip(camera.reference_T_camera[1, 1], -1.0, 1.0))))
    start = config.start
    changes = {
        name: float(np.hypot(getattr(start, name), tilt)) for name in ("level_sigma_deg", "pitch_sigma_deg")
    }
    return config.model_copy(update={"start": start.model_copy(update=changes)})


def seen_by(camera: RigCamera, recording: Recording) -> Recording:
    """Return the recording with another camera of its rig in place of the reference.

    The sensors have the places that they have on that camera. Control points, which belong to the
    picture of the reference camera, are left out, and so are the notes on the recording.
    """
    return replace(
        recording,
        video=camera.video,
        camera=camera.camera,
        rig=_mounted_on(camera, recording.rig),
        control_points=None,
        masks=camera.masks,
        notes=(),
        cameras=(),
    )


def _mounted_on(camera: RigCamera, rig: Rig) -> Rig:
    """Return the rig with the sensors' places on another of its cameras."""
    reference_T_camera = camera.reference_T_camera
    camera_T_reference = np.linalg.inv(reference_T_camera)
    gyro_R_reference = rig.gyro_R_camera
    return replace(
        rig,
        camera_p_antenna=camera_T_reference[:3, :3] @ rig.camera_p_antenna + camera_T_reference[:3, 3],
        gyro_R_camera=None if gyro_R_reference is None else gyro_R_reference @ reference_T_camera[:3, :3],
        imu=None if rig.imu is None else _imu_on(rig.imu, camera),
    )


def _imu_on(imu: ImuMount, camera: RigCamera) -> ImuMount:
    return replace(
        imu,
        imu_R_camera=imu.imu_R_camera @ camera.reference_T_camera[:3, :3],
        imu_p_camera=imu.imu_p_camera + imu.imu_R_camera @ camera.reference_T_camera[:3, 3],
    )
