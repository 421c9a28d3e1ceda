"""Scenes of the simulator, cut short and in small pictures."""

from dataclasses import replace

from vgps.simulate import SCENES, GpsConfig, SceneConfig


def shortened(scene: SceneConfig, seconds: float) -> SceneConfig:
    """Return the first seconds of a scene."""
    knots = tuple(knot for knot in scene.speed if knot[0] < seconds)
    return replace(scene, speed=(*knots, (seconds, knots[-1][1])))


def half_size(scene: SceneConfig) -> SceneConfig:
    """Return a scene in pictures of half its size (even numbers of pixels), with textures to match."""
    width, height, focal_px = scene.width // 4 * 2, scene.height // 4 * 2, scene.focal_px / 2
    return replace(scene, width=width, height=height, focal_px=focal_px, texture_scale=0.5)


def small_walk(fix_share: float) -> SceneConfig:
    """Return the walk of the demo in small pictures, with so much RTK-fix at either end (0.5 throughout)."""
    return replace(SCENES["demo"], width=320, height=240, focal_px=260.0, gps=GpsConfig(fix_share=fix_share))
