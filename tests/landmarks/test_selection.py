import numpy as np
from synthetic_landmarks import CAMERA, random_poses

from vgps.landmarks.selection import slabs, spread


def test_of_too_many_the_best_of_every_part_of_the_image_are_taken() -> None:
    rng = np.random.default_rng(0)
    uv = rng.uniform((-0.5, -0.5), (319.5, 239.5), (3000, 2))
    badness = rng.uniform(size=3000)
    rows = spread(uv, badness, CAMERA, 48)  # squares of 40 pixels, 8 x 6 of them
    assert len(rows) == 48 and (np.diff(rows) > 0).all()
    parts = {tuple(part) for part in ((uv[rows] + 0.5) // 40).astype(int).tolist()}
    assert len(parts) == 48
    for row in rows:
        same = ((uv + 0.5) // 40 == (uv[row] + 0.5) // 40).all(axis=1)
        assert badness[row] == badness[same].min()


def test_an_image_with_landmarks_in_one_part_alone_is_filled_from_there() -> None:
    uv = np.column_stack([np.linspace(1, 30, 50), np.full(50, 10.0)])
    badness = np.arange(50.0)
    assert spread(uv, badness, CAMERA, 5).tolist() == [0, 1, 2, 3, 4]
    assert spread(uv, badness, CAMERA, 50).tolist() == list(range(50))


def test_slabs_hold_every_point_in_view() -> None:
    rng = np.random.default_rng(1)
    for pose in random_poses(rng, 20):
        depth = rng.uniform(2.0, 300.0, 500)
        uv = rng.uniform((-0.5, -0.5), (319.5, 239.5), (500, 2))
        rays = np.column_stack([(uv - (CAMERA.cx, CAMERA.cy)) / (CAMERA.fx, CAMERA.fy), np.ones(500)])
        points = (depth[:, None] * rays) @ pose[:3, :3].T + pose[:3, 3]
        between, boxes = slabs(pose, CAMERA, 2.0, 300.0)
        np.testing.assert_allclose(between[1:, 0], between[:-1, 1])
        np.testing.assert_allclose(between[[0, -1], [0, 1]], [2.0, 300.0])
        of = np.searchsorted(between[1:, 0], depth, side="right")
        assert (points >= boxes[of, 0] - 1e-9).all() and (points <= boxes[of, 1] + 1e-9).all()


def test_no_depths_no_slabs() -> None:
    depths, boxes = slabs(np.eye(4), CAMERA, 5.0, 4.0)
    assert depths.shape == (0, 2) and boxes.shape == (0, 2, 3)
