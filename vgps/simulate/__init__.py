"""Simulated recordings with exact truth, in the files that a user has."""

from vgps.simulate.motion import Motion, build_motion
from vgps.simulate.recording import simulate
from vgps.simulate.render import Renderer
from vgps.simulate.scene import SCENES, SceneConfig, scene_config, scene_with_errors
from vgps.simulate.sensor_config import AccelerometerConfig, FixErrors, GpsConfig, GyroConfig
from vgps.simulate.street import build_world
from vgps.simulate.world import Builder, World

__all__ = [
    "SCENES",
    "AccelerometerConfig",
    "Builder",
    "FixErrors",
    "GpsConfig",
    "GyroConfig",
    "Motion",
    "Renderer",
    "SceneConfig",
    "World",
    "build_motion",
    "build_world",
    "scene_config",
    "scene_with_errors",
    "simulate",
]
