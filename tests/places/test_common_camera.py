from dataclasses import replace

import numpy as np
from textured_room import CAMERA, LENS, image, path

from vgps.camera import in_pinhole
from vgps.model import Frame
from vgps.places.common_camera import seen_by


def test_pixels_of_one_ray() -> None:
    other = replace(CAMERA, width=200, fx=130.0, fy=510.0, cx=99.0, cy=10.0)
    uv = np.array([[158.0, 121.0], [158.0 + 26.0, 121.0 - 25.5]])
    np.testing.assert_allclose(in_pinhole(uv, CAMERA, other), [[99.0, 10.0], [99.0 + 13.0, 10.0 - 51.0]])


def test_a_lens_is_seen_as_the_pinhole_sees_the_room() -> None:
    pose = path(1)[0]
    taken = Frame(2, 0.2, image(pose, LENS), image(pose, LENS) > 128)
    (shown,) = seen_by(CAMERA, LENS, [taken], 10)
    assert shown.index == 12 and shown.mask is not None
    inner = (slice(30, -30), slice(30, -30))
    difference = np.abs(shown.gray.astype(float) - image(pose, CAMERA))[inner]
    assert np.median(difference) < 3.0
    assert np.mean(shown.mask == (shown.gray > 128)) > 0.95
