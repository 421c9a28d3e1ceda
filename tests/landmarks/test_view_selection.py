import numpy as np
import pytest
from synthetic_landmarks import CAMERA, random_poses

from vgps.config import SelectionConfig
from vgps.geometry import project
from vgps.landmarks.view_selection import best_views, spread_over_image, visible_landmarks


@pytest.mark.parametrize("max_depth_m", [None, 60.0])
def test_what_is_in_the_image_is_what_double_precision_says(max_depth_m: float | None) -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(-90, 90, (50_000, 3))
    columns = np.vstack([points.T, np.ones(len(points))]).astype(np.float32)
    for pose in random_poses(rng, 5, 4.0):
        uv, depth = project(CAMERA.K, pose, points)
        borders = (uv + 0.5) @ np.array([[1, 0, -1, 0], [0, 1, 0, -1]]) + [0, 0, CAMERA.width, CAMERA.height]
        limits = np.column_stack([borders, depth - 0.1, (max_depth_m or 1e9) - depth])
        found = visible_landmarks(pose, CAMERA, columns, max_depth_m)
        sure = np.abs(limits).min(axis=1) > 1e-2
        inside = (limits > 0).all(axis=1)
        assert 500 < inside.sum() < 10_000
        assert set(np.flatnonzero(inside & sure)) <= set(found.row) <= set(np.flatnonzero(inside | ~sure))
        np.testing.assert_allclose(found.uv_px.T, uv[found.row], rtol=0, atol=1e-2)
        np.testing.assert_allclose(found.pixel_m, depth[found.row] / np.sqrt(260.0 * 255.0), rtol=1e-5)


def test_the_best_view_is_the_one_that_double_precision_finds() -> None:
    rng, config = np.random.default_rng(6), SelectionConfig(nearer_octaves=1.0, further_octaves=2.0)
    to_camera, pixel_m = rng.normal(size=(500, 3)), 2 ** rng.uniform(-6, -3, 500)
    there = rng.integers(1, 6, 500)[:, None] > np.arange(5)
    direction, normal = (to_camera[:, None] + rng.normal(scale=0.7, size=(500, 5, 3)) for _ in range(2))
    direction, normal = (v / np.linalg.norm(v, axis=2, keepdims=True) for v in (direction, normal))
    octave = np.log2(pixel_m)[:, None] + rng.uniform(-2.5, 1.5, (500, 5))
    view_geometry = np.concatenate([direction, normal, octave[..., None]], axis=2)
    view_geometry[~there] = np.nan
    found = best_views(
        to_camera.T.astype(np.float32),
        pixel_m.astype(np.float32),
        view_geometry.transpose(0, 2, 1).astype(np.float32),
        config,
    )
    here = to_camera / np.linalg.norm(to_camera, axis=1, keepdims=True)
    cosine, tilt = (np.einsum("nvi,ni->nv", v, here) for v in (direction, normal))
    larger = octave - np.log2(pixel_m)[:, None]
    suits = there & (cosine >= np.cos(np.radians(45))) & (tilt >= np.cos(np.radians(75)))
    suits &= (larger <= 1.0) & (larger >= -2.0)
    cost = np.where(suits, 2 * (1 - cosine) / np.radians(10) ** 2 + (larger / 0.5) ** 2, np.inf)
    expected = np.where(suits.any(axis=1), cost.argmin(axis=1), -1)
    assert 50 < (expected < 0).sum() < 450 and len(np.unique(expected)) == 6
    np.testing.assert_array_equal(found.view, expected)
    good = np.flatnonzero(expected >= 0)
    np.testing.assert_allclose(found.cost[good], cost[good, expected[good]], rtol=1e-4, atol=1e-4)
    sine = np.linalg.norm(np.cross(direction[good, expected[good]], here[good]), axis=1)
    np.testing.assert_allclose(found.sine[good], sine, atol=1e-3)


def test_of_too_many_the_first_of_every_part_of_the_image_are_taken() -> None:
    rng = np.random.default_rng(0)
    uv = rng.uniform((-0.5, -0.5), (319.5, 239.5), (3000, 2)).astype(np.float32)
    rows = spread_over_image(uv.T, (320, 240), 48)  # squares of 40 pixels, 8 x 6 of them
    assert len(rows) == 48 and (np.diff(rows) > 0).all()
    parts = {tuple(part) for part in ((uv[rows] + 0.5) // 40).astype(int).tolist()}
    assert len(parts) == 48
    for row in rows:
        same = ((uv + 0.5) // 40 == (uv[row] + 0.5) // 40).all(axis=1)
        assert row == np.flatnonzero(same)[0]


def test_an_image_with_landmarks_in_one_part_alone_is_filled_from_there() -> None:
    uv = np.stack([np.linspace(1, 30, 50), np.full(50, 10.0)]).astype(np.float32)
    assert spread_over_image(uv, (320, 240), 5).tolist() == [0, 1, 2, 3, 4]
    assert spread_over_image(uv, (320, 240), 50).tolist() == list(range(50))
