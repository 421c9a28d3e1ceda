"""The IMU of a recording against the rotations of stages A to C: left out, or its clock corrected."""

from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.imu.agreement import Agreement, agreement, path_rotations
from vgps.imu.force_agreement import wrong_forces
from vgps.mapping.trajectory import map_trajectory
from vgps.model import Recording
from vgps.pipeline.front_end import FrontEnd, camera_imu
from vgps.runtime.progress import Progress
from vgps.solution import Trajectory
from vgps.tracking.relative_rotation import frame_rotations

_CALIBRATE = "vgps calibrate-imu"


def imu_agreement(front_end: FrontEnd, config: Config, progress: Progress) -> Agreement:
    """Compare the rotations of a front end's IMU, if it has one, with those of its maps.

    Maps may be bent by some degrees themselves: where they contradict the IMU, pairs of pictures decide.
    """
    imu = camera_imu(front_end.recording, front_end.origin, config)
    if imu is None:
        return Agreement(None)
    by_maps = agreement(path_rotations([map_trajectory(one) for one in front_end.maps]), imu)
    if by_maps.contradiction is None:
        return by_maps
    by_pictures = pictures_agreement(front_end, config, progress)
    return by_pictures if by_pictures.shown else by_maps


def pictures_agreement(front_end: FrontEnd, config: Config, progress: Progress) -> Agreement:
    """Compare the rotations of a front end's IMU with those of pairs of pictures, which never met it."""
    recording, settings = front_end.recording, config.gyro_calibration
    imu = camera_imu(recording, front_end.origin, config)
    if imu is None:
        return Agreement(None)
    progress.stage("comparing the IMU with pairs of pictures")
    video = recording.video
    rotations = frame_rotations(
        progress.track(video.frames(), len(video.times_s)),
        recording.camera,
        config.tracking,
        np.random.default_rng(config.seed),
        settings.rotation,
        min_interval_s=settings.min_interval_s,
    )
    return agreement(rotations, imu)


def contradiction_note(front_end: FrontEnd, found: Agreement) -> str | None:
    """Return the warning that an IMU is left out; None if nothing contradicts it."""
    imu, contradiction = front_end.recording.imu, found.contradiction
    if found.misled:
        contradiction = contradiction or f"its clock seems to be off by {found.time_offset_s:.3f} s"
    if imu is None or contradiction is None:
        return None
    return f"{imu.source.name} is left out: {contradiction}; calibrate it with {_CALIBRATE}"


def force_note(front_end: FrontEnd, path: Trajectory, config: Config) -> str | None:
    """Return the warning that the accelerometer contradicts a path; None if nothing shows it."""
    recording = front_end.recording
    imu, mount = camera_imu(recording, front_end.origin, config), recording.rig.imu
    right = None if imu is None or mount is None else wrong_forces(path, imu, mount)
    if imu is None or right is None:
        return None
    return (
        f"{imu.source.name} only predicted rotations: its specific force contradicts the path, and would fit "
        f"with {right}"
    )


def with_imu_clock(recording: Recording, found: Agreement) -> Recording:
    """Return a recording with the IMU's clock as the rotations show it, and a note if it was shifted."""
    imu, offset_s = recording.imu, found.time_offset_s
    if imu is None or not offset_s:
        return recording
    note = (
        f"{imu.source.name} was shifted by {offset_s:.4f} s (standard deviation "
        f"{found.time_offset_sigma_s:.4f} s), as its rotations and the video's show: add it to "
        f"imu_time_offset_s in rig.yaml, or run {_CALIBRATE}"
    )
    shifted = replace(imu, t_s=imu.t_s + offset_s)
    return replace(recording, imu=shifted, notes=(*recording.notes, note))
