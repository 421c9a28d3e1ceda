"""Scenes of the simulator, cut short and in small pictures."""

from dataclasses import replace

from vgps.simulate import SceneConfig


def shortened(scene: SceneConfig, seconds: float) -> SceneConfig:
    """Return the first seconds of a scene."""
    knots = tuple(knot for knot in scene.speed if knot[0] < seconds)
    return replace(scene, speed=(*knots, (seconds, knots[-1][1])))


def half_size(scene: SceneConfig) -> SceneConfig:
    """Return a scene in pictures of half its size (even numbers of pixels), with textures to match."""
    width, height, focal_px = scene.width // 4 * 2, scene.height // 4 * 2, scene.focal_px / 2
    return replace(scene, width=width, height=height, focal_px=focal_px, texture_scale=0.5)
