from dataclasses import replace

import cv2
import numpy as np
import pytest
from rendered_boards import CONFIG, FRONT, WEST, board_and_corners, moving, plain, project

from vgps.simulate import Builder, Renderer
from vgps.simulate.world import UP


@pytest.mark.parametrize(
    "start",
    [
        (0, 0, 0, 0, 0, 0),  # facing it, magnified
        (-14, 0, 0, 0, 0, 0.2),  # far, 15 px across a board whose texture is 512
        (2.5, -2.9, 0.4, 0.75, 0.05, 0.1),  # near and slanting
    ],
)
@pytest.mark.parametrize("size", [64, 512])
def test_corners_are_drawn_where_the_truth_puts_them(start: tuple[float, ...], size: int) -> None:
    squares = 4 if start[0] < -5 else 8
    world, corners = board_and_corners(squares, size)
    config = replace(CONFIG, focal_px=900.0) if start[0] < -5 else CONFIG
    motion = moving(start=start)
    renderer = Renderer(world, motion, config)
    gray = cv2.cvtColor(renderer.frame(0), cv2.COLOR_BGR2GRAY)
    expected = project(renderer, motion.poses(np.zeros(1))[0], corners)
    inside = np.all((expected > 8) & (expected < [config.width - 8, config.height - 8]), axis=1)
    assert inside.sum() >= 9
    expected = expected[inside].astype(np.float32).reshape(-1, 1, 2)
    offset = np.random.default_rng(0).uniform(-1, 1, expected.shape).astype(np.float32)
    found = cv2.cornerSubPix(gray, expected + offset, (3, 3), (-1, -1), (3, 50, 1e-4))
    # what is left is the detector's own: a board drawn sixteen times larger and averaged gives the same
    np.testing.assert_allclose((found - expected).mean(axis=(0, 1)), 0.0, atol=0.03)
    error = np.linalg.norm(found - expected, axis=-1)
    assert np.median(error) < 0.12
    assert error.max() < 0.35


def test_a_repeating_texture_is_drawn_where_the_truth_puts_it() -> None:
    world, corners = board_and_corners(2, 256, repeat=4)
    plain_world, _ = board_and_corners(8, 1024)
    motion = moving(start=(1.5, 0.4, 0.2, 0.1, 0.05, 0.3))
    repeated, single = (Renderer(w, motion, CONFIG).frame(0) for w in (world, plain_world))
    renderer = Renderer(world, motion, CONFIG)
    uv = project(renderer, motion.poses(np.zeros(1))[0], corners)
    inside = np.all((uv > 2) & (uv < [CONFIG.width - 3, CONFIG.height - 3]), axis=1)
    for u, v in np.round(uv[inside]).astype(int):
        patch = np.s_[v - 1 : v + 2, u - 1 : u + 2]
        np.testing.assert_allclose(repeated[patch].astype(int), single[patch].astype(int), atol=12)


def test_edges_cover_the_exact_share_of_a_pixel() -> None:
    builder = Builder()
    builder.upright(FRONT, WEST, 2.0, 2.0, builder.image(plain((0, 0, 0))))
    picture = Renderer(builder.world(), moving(), CONFIG).frame(0).astype(float)
    sky = picture[0, 0, 0]
    dark = 1 - (picture[120, :, 0] / sky) ** 2  # linear light
    assert dark.sum() == pytest.approx(300.0 * 2.0 / 6.0, abs=0.6)


def test_the_nearer_hides_the_farther_in_whatever_order_they_come() -> None:
    for order in (1, -1):
        builder = Builder()
        walls = [(np.array([6.0, 0, -1]), (0, 0, 200)), (np.array([9.0, 0, -1]), (0, 200, 0))]
        for foot, color in walls[::order]:
            builder.upright(foot, WEST, 1.0 if foot[0] < 7 else 6.0, 2.0, builder.image(plain(color)))
        picture = Renderer(builder.world(), moving(), CONFIG).frame(0)
        assert picture[120, 160].tolist() == [0, 0, 200]
        assert picture[120, 100].tolist() == [0, 200, 0]


def test_crossing_walls_part_where_they_cross() -> None:
    builder = Builder()
    for slope, color in ((0.5, (0, 0, 200)), (-0.5, (0, 200, 0))):
        across = np.array([slope, -1.0, 0.0]) * 2
        builder.add(
            np.array([6.0, 0, 1.0]) - across / 2,
            across,
            -2.0 * UP,
            builder.image(plain(color)),
            two_sided=True,
        )
    row = Renderer(builder.world(), moving(), CONFIG).frame(0)[120]
    assert row[135].tolist() == [0, 0, 200]  # left of the crossing the first is nearer
    assert row[185].tolist() == [0, 200, 0]


@pytest.mark.parametrize("turned", [0.0, np.pi])
def test_back_sides_and_things_behind_the_camera_are_not_drawn(turned: float) -> None:
    builder = Builder()
    builder.upright(FRONT, WEST, 4.0, 4.0, builder.image(plain((0, 0, 200))))
    world = builder.world()
    seen = Renderer(world, moving(start=(0, 0, 0, turned, 0, 0)), CONFIG).frame(0)[120, 160]
    assert (seen.tolist() == [0, 0, 200]) == (turned == 0.0)
    from_behind = Renderer(world, moving(start=(12.0, 0, 0, np.pi, 0, 0)), CONFIG).frame(0)[120, 160]
    assert from_behind.tolist() != [0, 0, 200]


def test_transparent_texels_show_what_is_behind() -> None:
    builder = Builder()
    hole = plain((0, 0, 200))
    hole[16:48, 16:48, 3] = 0
    builder.upright(FRONT, WEST, 2.0, 2.0, builder.image(hole))
    builder.upright(FRONT + np.array([3.0, 0, -2]), WEST, 6.0, 6.0, builder.image(plain((0, 200, 0))))
    picture = Renderer(builder.world(), moving(), CONFIG).frame(0)
    assert picture[120, 160].tolist() == [0, 200, 0]
    assert picture[120, 118].tolist() == [0, 0, 200]


def test_ground_passing_under_the_camera_is_cut_at_the_near_plane() -> None:
    builder = Builder()
    builder.flat(np.array([0.0, 0, -1.6]), 0.0, 400.0, 400.0, builder.image(plain((10, 90, 10))))
    picture = Renderer(builder.world(), moving(start=(0, 0, 0, 0, -0.1, 0.1)), CONFIG).frame(0)
    assert picture[230, :].tolist() == [[10, 90, 10]] * CONFIG.width
    assert picture[5, 160].tolist() != [10, 90, 10]


@pytest.mark.parametrize("rate_deg_s", [20.0, 100.0, -300.0])
def test_blur_is_as_long_as_the_rotation_within_the_exposure(rate_deg_s: float) -> None:
    builder = Builder()
    builder.upright(FRONT, WEST, 0.04, 2.0, builder.image(plain((255, 255, 255))))  # 2 px wide
    builder.upright(FRONT + np.array([0.01, 0, 0]), WEST, 12.0, 2.0, builder.image(plain((0, 0, 0))))
    config = replace(CONFIG, exposure_s=0.05, max_samples=200)
    motion = moving(rates=(0, 0, 0, np.deg2rad(rate_deg_s), 0, 0))
    renderer = Renderer(builder.world(), motion, config)
    light = (renderer.frame(0)[120, :, 0] / 255.0) ** 2
    columns = np.arange(config.width)
    length = config.focal_px * np.deg2rad(abs(rate_deg_s)) * config.exposure_s
    mean = (light * columns).sum() / light.sum()
    assert mean == pytest.approx(159.5, abs=0.3)  # the time stamp is the middle of the exposure
    spread = np.sqrt((light * (columns - mean) ** 2).sum() / light.sum())
    # the stripe and the pixel are 2 and 1 px wide themselves
    assert spread * np.sqrt(12) == pytest.approx(np.sqrt(length**2 + 2.0**2 + 1.0**2), rel=0.02, abs=0.5)
    assert light.sum() == pytest.approx(2.0, rel=0.1)  # blur spreads light and keeps its amount
    assert renderer.samples(0.0) >= length


def test_moving_things_follow_their_velocity() -> None:
    builder = Builder(velocity=np.array([0.0, -1.0, 0.0]), epoch_s=0.5)
    builder.upright(FRONT, WEST, 0.5, 2.0, builder.image(plain((0, 0, 0))))
    renderer = Renderer(builder.world(), moving(), CONFIG)
    for index in (0, 5, 15):
        dark = renderer.frame(index)[120, :, 0] < 100
        assert np.flatnonzero(dark).mean() == pytest.approx(159.5 + 300 / 6 * (index / 10 - 0.5), abs=0.5)


def test_noise_has_its_size_and_differs_between_frames() -> None:
    builder = Builder()
    builder.upright(FRONT - np.array([5.0, 0, 3]), WEST, 9.0, 9.0, builder.image(plain((120, 120, 120))))
    renderer = Renderer(builder.world(), moving(), replace(CONFIG, noise_levels=3.0))
    first, second = (renderer.frame(k).astype(float)[..., 1] for k in (0, 1))
    assert first.std() == pytest.approx(3.0, rel=0.05)
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.02
    assert first.mean() == pytest.approx(120, abs=0.2)
