from dataclasses import replace

import numpy as np

from vgps.camera import distort
from vgps.landmarks.rectify import Rectifier
from vgps.model import Camera

PINHOLE = Camera(model="pinhole", width=320, height=240, fx=300.0, fy=300.0, cx=160.0, cy=120.0)


def test_an_edge_is_where_the_lens_model_puts_it() -> None:
    # black left of a column of the distorted image, bright right of it
    lens = replace(PINHOLE, model="opencv", distortion=(-0.2, 0.05, 0.001, -0.002))
    u, v = np.meshgrid(np.arange(320.0), np.arange(240.0))
    source = distort(lens, np.column_stack([u.ravel(), v.ravel()]))
    inside = ((source > 2) & (source < (316, 236))).all(axis=1)
    image = np.zeros((240, 320), np.uint8)
    image[:, 100:] = 200
    out = Rectifier(lens)(image).ravel()
    clear = inside & (np.abs(source[:, 0] - 99.5) > 1.5)
    np.testing.assert_array_equal(out[clear] > 100, source[clear, 0] > 99.5)


def test_a_pinhole_image_is_unchanged() -> None:
    image = np.random.default_rng(1).integers(0, 255, (240, 320)).astype(np.uint8)
    np.testing.assert_array_equal(Rectifier(PINHOLE)(image), image)
