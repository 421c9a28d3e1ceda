"""Scenes: motion, camera, surroundings and sensors of a simulated recording."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from vgps.errors import ConfigError
from vgps.model import GeodeticPoint
from vgps.simulate.camera_path import CameraPath
from vgps.simulate.flights import drone_path, orbit_path
from vgps.simulate.sensor_config import AccelerometerConfig, GpsConfig, GyroConfig
from vgps.survey import read_errors

_ORIGIN = GeodeticPoint(34.7325, 135.7345, 120.0)


@dataclass(frozen=True, kw_only=True)
class SceneConfig:
    """A scene: motion, camera, surroundings, sensors. Change fields with :func:`dataclasses.replace`.

    Attributes:
        speed: Knots (time [s], speed [m/s]); the last one ends the recording.
        bends: Each with the distance at which it starts [m], length [m], angle [deg], left positive.
        path: A path to follow instead, without bobbing, shaking or looking around.
        look_alike_m: Distance along the path after which houses, trees and cars repeat; 0 if they do not.
        fps, width, height, focal_px, exposure_s: The camera, a pinhole with a central principal point.
        fisheye_deg: Diagonal field of view of an equidistant fisheye in place of the pinhole, at most 170;
            0 for the pinhole.
        panorama_deg: 360 for an equirectangular picture of the whole sphere; else the angle that a circular
            fisheye sees across the shorter side; 0 for none of them.
        readout_s: Time from the exposure of the first row to that of the last; 0 for a global shutter. The
            middle of the middle row's exposure is the frame's time stamp, and the time of its true pose.
        camera_p_antenna: Antenna in the camera frame, metres (x right, y down, z forward).
        eye_m: The camera's height above ground.
        bob_hz, bob_m, sway_deg: A walker's bobbing up and down, and swaying at half that frequency.
        shake_deg, look_deg: Amplitudes of quick shaking (of a moving vehicle) and of slow looking around.
        hand_shake: Shaking of a hand that holds the camera, 1 as the gyro of a walker's GoPro measured it.
        pitch_deg, roll_deg: Mean tilt of the camera, up positive, and about its viewing axis, clockwise
            positive.
        spin_deg_s, spin_period_s: Peak rate and period of panning to and fro, fading in after a quarter of
            the recording.
        surface: Texture of the ground.
        setback_m: Least and largest distance of the facades from the path.
        moving: Whether cars and walkers pass by.
        texture_scale: Scale of the textures' resolution; smaller is faster.
        noise_levels: Sensor noise, standard deviation in grey levels.
        max_samples: Largest number of instants rendered and averaged for a frame.
        cameras: Number of cameras of the rig, in a ring around the first one's place, looking outwards.
        crf: Quality of the H.264 video (lower is better).
        gps, gyro: Receiver and gyro.
        accelerometer: Makes the gyro an IMU; None without one.
        pass_seed: Seed of the shaking and of the sensors' errors, if these are to differ from recording to
            recording in one world.
        start_utc: UTC of the first frame.
        world_origin: Origin of the ENU world.
    """

    speed: tuple[tuple[float, float], ...]
    bends: tuple[tuple[float, float, float], ...]
    path: CameraPath | None = field(default=None, repr=False)
    look_alike_m: float = 0.0
    fps: int = 15
    width: int = 720
    height: int = 480
    focal_px: float = 620.0
    exposure_s: float = 0.0025
    fisheye_deg: float = 0.0
    panorama_deg: float = 0.0
    readout_s: float = 0.0
    camera_p_antenna: tuple[float, float, float] = (0.05, -0.42, -0.12)
    eye_m: float = 1.6
    bob_hz: float = 1.8
    bob_m: float = 0.025
    sway_deg: float = 0.5
    shake_deg: float = 0.0
    look_deg: float = 3.0
    hand_shake: float = 0.0
    pitch_deg: float = 3.0
    roll_deg: float = 0.0
    spin_deg_s: float = 0.0
    spin_period_s: float = 3.0
    surface: Literal["paving", "asphalt"] = "paving"
    setback_m: tuple[float, float] = (5.0, 9.0)
    moving: bool = False
    texture_scale: float = 1.0
    noise_levels: float = 1.5
    max_samples: int = 64
    cameras: int = 1
    crf: int = 16
    gps: GpsConfig = field(default_factory=GpsConfig)
    gyro: GyroConfig = field(default_factory=GyroConfig)
    accelerometer: AccelerometerConfig | None = None
    pass_seed: int | None = None
    start_utc: datetime = datetime(2025, 6, 1, 12, 0, 0, tzinfo=UTC)
    world_origin: GeodeticPoint = _ORIGIN

    @property
    def frames(self) -> int:
        """Number of frames; the last speed knot is the time after the last frame."""
        return round(self.speed[-1][0] * self.fps)

    @property
    def duration_s(self) -> float:
        """Time of the last frame."""
        return (self.frames - 1) / self.fps


_WALK = SceneConfig(
    speed=((0.0, 0.9), (15.0, 1.0), (30.0, 0.9), (45.0, 0.98), (60.0, 0.92), (74.0, 0.96)),
    bends=((8.0, 8.0, 35.0), (24.0, 10.0, -60.0), (42.0, 9.0, 50.0), (57.0, 8.0, 40.0)),
)
_DRIVE = SceneConfig(
    speed=(
        *((0.0, 6.0), (6.0, 9.5), (12.0, 8.5), (17.0, 5.0), (22.0, 9.0), (28.0, 8.0), (33.0, 0.0)),
        *((39.0, 0.0), (45.0, 8.0), (51.0, 9.5), (56.0, 5.5), (61.0, 9.0), (66.0, 7.0)),
    ),
    bends=((70.0, 40.0, 15.0), (122.0, 22.0, -85.0), (190.0, 40.0, 20.0), (330.0, 24.0, 80.0)),
    fps=10,
    width=1242,
    height=374,
    focal_px=720.0,
    exposure_s=0.001,
    camera_p_antenna=(0.05, -0.93, -0.32),
    eye_m=1.65,
    bob_m=0.0,
    sway_deg=0.0,
    shake_deg=0.15,
    look_deg=0.0,
    pitch_deg=0.0,
    surface="asphalt",
    setback_m=(8.0, 14.0),
)


def on_path(scene: SceneConfig, path: CameraPath) -> SceneConfig:
    """Return the scene with a given path in place of its own."""
    return replace(
        scene, path=path, speed=((0.0, path.speed_m_s), (path.duration_s, path.speed_m_s)), bends=()
    )


SCENES: Mapping[str, SceneConfig] = MappingProxyType(
    {
        "walk": _WALK,
        "drive": _DRIVE,
        "demo": replace(_WALK, speed=((0.0, 1.2), (13.0, 1.2)), bends=((2.5, 5.0, 40.0), (9.5, 5.0, -65.0))),
        "spin": replace(
            _WALK,
            speed=((0.0, 1.0), (15.0, 1.0)),
            bends=((3.0, 8.0, 40.0),),
            spin_deg_s=150.0,
            exposure_s=1 / 15,
        ),
        "drone": replace(
            on_path(_WALK, drone_path()),
            fps=10,
            eye_m=2.0,
            setback_m=(9.0, 14.0),
            camera_p_antenna=(0.0, -0.15, -0.1),
        ),
        "orbit": replace(on_path(_WALK, orbit_path()), fps=10, setback_m=(6.0, 9.0)),
    }
)


def scene_config(name: str) -> SceneConfig:
    """Return the scene of that name.

    Raises:
        ConfigError: There is no such scene.
    """
    if name not in SCENES:
        raise ConfigError(f"unknown scene {name!r}", expected="one of " + ", ".join(SCENES), place="--scene")
    return SCENES[name]


def scene_with_errors(name: str, log: Path | None = None, reference: Path | None = None) -> SceneConfig:
    """Return the scene of that name, with the errors of a real receiver if a log is given.

    Args:
        name: One of ``SCENES``.
        log, reference: As for :func:`vgps.survey.read_errors`.

    Raises:
        ConfigError: There is no such scene, or a reference is given without a log.
        GpsLogError: A log cannot be read, or has no truth.
    """
    scene = scene_config(name)
    if log is None:
        if reference is not None:
            raise ConfigError("a reference without a log of errors", place="--gps-reference")
        return scene
    return replace(scene, gps=replace(scene.gps, replay=read_errors(log, reference)))
