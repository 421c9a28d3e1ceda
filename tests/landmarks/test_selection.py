import numpy as np
from synthetic_landmarks import CAMERA

from vgps.landmarks.selection import spread


def test_of_too_many_the_first_of_every_part_of_the_image_are_taken() -> None:
    rng = np.random.default_rng(0)
    uv = rng.uniform((-0.5, -0.5), (319.5, 239.5), (3000, 2))
    rows = spread(uv, CAMERA, 48)  # squares of 40 pixels, 8 x 6 of them
    assert len(rows) == 48 and (np.diff(rows) > 0).all()
    parts = {tuple(part) for part in ((uv[rows] + 0.5) // 40).astype(int).tolist()}
    assert len(parts) == 48
    for row in rows:
        same = ((uv + 0.5) // 40 == (uv[row] + 0.5) // 40).all(axis=1)
        assert row == np.flatnonzero(same)[0]


def test_an_image_with_landmarks_in_one_part_alone_is_filled_from_there() -> None:
    uv = np.column_stack([np.linspace(1, 30, 50), np.full(50, 10.0)])
    assert spread(uv, CAMERA, 5).tolist() == [0, 1, 2, 3, 4]
    assert spread(uv, CAMERA, 50).tolist() == list(range(50))
