from dataclasses import replace

import cv2
import numpy as np
import pytest
from rendered_boards import CONFIG, FRONT, WEST, board_and_corners, moving, plain, project

from vgps.simulate import SCENES, Builder, Renderer, build_motion, build_world
from vgps.simulate.faces import texture_maps

READOUT_S = 0.06


@pytest.mark.slow
def test_a_readout_in_no_time_is_a_global_shutter() -> None:
    scene = replace(SCENES["demo"], width=320, height=240, focal_px=280.0, texture_scale=0.3, moving=True)
    motion, world = (f(scene, np.random.default_rng(2)) for f in (build_motion, build_world))
    still, rolling = (
        Renderer(world, motion, replace(scene, readout_s=s)).frame(20).astype(int) for s in (0.0, 1e-9)
    )
    assert np.abs(still - rolling).mean() < 0.1
    assert np.mean(np.abs(still - rolling) > 20) < 1e-3


@pytest.mark.parametrize(
    "rates",
    [
        (0, 0, 0, 1.0, 0, 0),
        (0, 0, 0, -0.4, 0.8, 0.5),
        (3.0, -6.0, 4.0, 0, 0, 0),
        (5.0, 3.0, 0, 0.5, -0.5, 1.0),
    ],
)
def test_corners_are_where_their_row_sees_them(rates: tuple[float, ...]) -> None:
    world, corners = board_and_corners()
    motion, config = moving(rates), replace(CONFIG, readout_s=READOUT_S, exposure_s=1e-6)
    renderer = Renderer(world, motion, config)
    gray = cv2.cvtColor(renderer.frame(0), cv2.COLOR_BGR2GRAY)
    expected = project(renderer, motion.poses(np.zeros(1))[0], corners)
    middle = expected.copy()
    for _ in range(20):  # the row depends on the time, and the time on the row
        t = READOUT_S * (expected[:, 1] / (config.height - 1) - 0.5)
        expected = np.concatenate(
            [project(renderer, T, p[None]) for T, p in zip(motion.poses(t), corners, strict=True)]
        )
    inside = np.all((expected > 8) & (expected < [config.width - 8, config.height - 8]), axis=1)
    assert inside.sum() >= 20
    assert np.abs(expected - middle)[inside].max() > 2.0  # so that a global shutter would fail
    start = expected[inside].astype(np.float32).reshape(-1, 1, 2)
    found = cv2.cornerSubPix(gray, start.copy(), (3, 3), (-1, -1), (3, 50, 1e-4))
    error = np.linalg.norm(found - start, axis=-1)
    assert np.median(error) < 0.12
    assert error.max() < 0.4


def test_moving_things_lean() -> None:
    builder = Builder(velocity=np.array([0.0, -4.0, 0.0]))
    builder.upright(FRONT - [0, 0, 4.0], WEST, 0.2, 10.0, builder.image(plain((0, 0, 0))))
    picture = Renderer(builder.world(), moving(), replace(CONFIG, readout_s=READOUT_S)).frame(0)[..., 0]
    dark = 1 - (picture[[5, 234]] / picture[5, 0]) ** 2  # linear light
    top, bottom = (dark * np.arange(CONFIG.width)).sum(axis=1) / dark.sum(axis=1)
    assert bottom - top == pytest.approx(300 * 4.0 / 6.0 * READOUT_S * 229 / 239, abs=0.1)


def test_a_board_seen_from_its_own_plane_is_no_more_than_a_line() -> None:
    """The middle row is filmed from that plane, the rows above and below it from a centimetre off."""
    config, builder = replace(CONFIG, readout_s=READOUT_S), Builder()
    builder.flat(np.array([4.0, 0.0, 0.0]), 0.0, 4.0, 2.0, builder.image(plain((0, 0, 0))))
    world, rising = builder.world(), moving((0, 0, 0.5, 0, 0, 0))
    (middle,) = rising.poses(np.zeros(1))
    assert np.isfinite(texture_maps(world, np.array([0]), np.eye(3), middle, 0.0)).all()
    picture = Renderer(world, rising, config).frame(0)
    rows = np.flatnonzero(picture.min(axis=(1, 2)) < 50)
    assert np.all(np.abs(rows - config.height // 2) <= 4)
