from dataclasses import replace

import numpy as np
import pytest

from vgps.simulate.motion import build_motion, center_line
from vgps.simulate.scene import SCENES
from vgps.simulate.street import build_world

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", ["demo", "drive"])
def test_nothing_stands_on_the_cameras_path(name: str) -> None:
    config = replace(SCENES[name], texture_scale=0.05)
    world = build_world(config, np.random.default_rng(4))
    t_s = np.arange(config.frames) / config.fps
    camera = build_motion(config, np.random.default_rng(1)).poses(t_s)[:, :3, 3]
    low = np.minimum(world.origin[:, 2], (world.origin + world.edge_v)[:, 2])
    upright = np.flatnonzero((np.abs(world.edge_v[:, 2]) > 0.1) & (low < config.eye_m))
    assert len(upright) > 50
    # distance of the camera from the nearest point of the foot of each upright rectangle
    foot, edge = world.origin[upright, None, :2], world.edge_u[upright, None, :2]
    along = np.sum((camera[None, :, :2] - foot) * edge, axis=2) / np.sum(edge**2, axis=2)
    nearest = foot + np.clip(along, 0, 1)[..., None] * edge
    assert np.linalg.norm(camera[None, :, :2] - nearest, axis=2).min() > 0.5


def test_traffic_moves_and_is_there_only_when_asked_for() -> None:
    config = replace(SCENES["demo"], texture_scale=0.05)
    still = build_world(config, np.random.default_rng(4))
    assert not still.velocity.any()
    moving = build_world(replace(config, moving=True), np.random.default_rng(4))
    speed = np.unique(np.linalg.norm(moving.velocity, axis=1).round(3))
    assert speed.tolist() == [0.0, 1.3, 4.0]


def test_the_ground_reaches_beyond_the_ends_of_the_path() -> None:
    config = replace(SCENES["drive"], texture_scale=0.05)
    world = build_world(config, np.random.default_rng(4))
    (ground,) = np.flatnonzero((world.repeat > 1) & (world.edge_u[:, 2] == 0))
    line = center_line(config, 45.0, 90.0)[:, 1:3]
    corner = world.origin[ground, :2]
    span = world.edge_u[ground, :2] + world.edge_v[ground, :2]
    inside = (line - corner) / span
    assert inside.min() > 0.1 and inside.max() < 0.9
