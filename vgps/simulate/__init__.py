"""A world with exact truth, rendered to the same files a user has."""

from vgps.simulate.motion import Motion, build_motion
from vgps.simulate.recording import simulate
from vgps.simulate.render import Renderer
from vgps.simulate.scene import SCENES, FixErrors, GpsConfig, GyroConfig, SceneConfig, scene_config
from vgps.simulate.street import build_world
from vgps.simulate.world import Builder, World

__all__ = [
    "SCENES",
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
    "simulate",
]
