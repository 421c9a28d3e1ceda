"""Scenes of the simulator, cut short and in small pictures."""

from dataclasses import replace

from vgps.simulate import SCENES, SceneConfig


def small(name: str, seconds: float) -> SceneConfig:
    """The first seconds of a scene, in pictures of half its size."""
    scene = SCENES[name]
    knots = tuple(knot for knot in scene.speed if knot[0] < seconds)
    return replace(
        scene,
        speed=(*knots, (seconds, knots[-1][1])),
        width=scene.width // 4 * 2,
        height=scene.height // 4 * 2,
        focal_px=scene.focal_px / 2,
        texture_scale=0.5,
    )
