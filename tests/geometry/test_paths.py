import numpy as np

from vgps.geometry import travelled


def test_a_path_grows_by_its_steps() -> None:
    centres = np.array([[1.0, 1.0, 1.0], [4.0, 5.0, 1.0], [4.0, 5.0, 1.0], [4.0, 5.0, -1.0]])
    assert travelled(centres).tolist() == [0.0, 5.0, 5.0, 7.0]


def test_a_path_without_points_has_no_lengths() -> None:
    assert travelled(np.zeros((0, 3))).tolist() == []
    assert travelled(np.ones((1, 3))).tolist() == [0.0]
