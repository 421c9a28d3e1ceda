"""Pairs of views of random points, with exact lens and motion."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.camera import project
from vgps.model import Camera
from vgps.tracking.view_pairs import ViewPairs

Pairs = Callable[..., ViewPairs]


def _pairs(
    camera: Camera, count: int = 10, features: int = 90, noise_px: float = 0.2, turn_deg: float = 8.0
) -> ViewPairs:
    """A camera moves by a tenth of the points' distance and turns about all axes; a tenth of the matches are
    wrong."""
    rng = np.random.default_rng(7)
    first, second, pair = [], [], []
    for index in range(count):
        turn = Rotation.from_rotvec(np.radians(turn_deg) * rng.normal(size=3) * (0.6, 1.0, 0.3)).as_matrix()
        move = rng.normal(size=3) * (0.5, 0.2, 1.0)
        ray = np.column_stack([rng.uniform(-2.5, 2.5, 4000), rng.uniform(-2, 2, 4000), np.ones(4000)])
        points = ray * rng.uniform(4, 15, (4000, 1))
        a, b = project(camera, points), project(camera, points @ turn.T + move)
        inside = [np.all((uv > 0) & (uv < (camera.width, camera.height)), axis=1) for uv in (a, b)]
        kept = np.flatnonzero(inside[0] & inside[1])[:features]
        a, b = (uv[kept] + rng.normal(0, noise_px, (len(kept), 2)) for uv in (a, b))
        wrong = rng.random(len(kept)) < 0.1
        b[wrong] += rng.normal(0, 20, (wrong.sum(), 2))
        first.append(a), second.append(b), pair.append(np.full(len(kept), index))
    return ViewPairs(np.concatenate(first), np.concatenate(second), np.concatenate(pair), count)


@pytest.fixture
def pairs() -> Pairs:
    """Return a function of a camera, number of pairs, features, noise and rotation that gives pairs."""
    return _pairs
