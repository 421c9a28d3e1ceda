import numpy as np

from vgps.landmarks.farthest_point_sampling import ViewMetric, sample_farthest


def place(degrees: list[float], octaves: list[float] | None = None) -> np.ndarray:
    angle = np.radians(degrees)
    direction = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    return ViewMetric(10.0, 0.5).coordinates(direction, np.array(octaves or [0.0] * len(degrees)))


def chosen(landmark: list[int], places: np.ndarray, count: int, least: float = 0.0, errors=None) -> list[int]:
    error_px = np.zeros(len(landmark)) if errors is None else np.array(errors)
    return np.flatnonzero(sample_farthest(np.array(landmark), places, error_px, count, least)).tolist()


def test_ten_degrees_count_as_half_an_octave() -> None:
    apart = place([0.0, 10.0, 0.0], [0.0, 0.0, 0.5])
    assert abs(np.linalg.norm(apart[1] - apart[0]) - 1) < 0.002
    assert np.linalg.norm(apart[2] - apart[0]) == 1


def test_the_first_is_the_best_and_the_next_the_furthest() -> None:
    errors = [0.5, 0.1, 0.5, 0.5]
    assert chosen([3] * 4, place([0, 10, 20, 60]), 1, errors=errors) == [1]
    assert chosen([3] * 4, place([0, 10, 20, 60]), 2, errors=errors) == [1, 3]
    # from 10 and 60 degrees, 20 and 0 are ten away alike; the former has the smaller error
    assert chosen([3] * 4, place([0, 10, 20, 60]), 3, errors=[0.5, 0.1, 0.4, 0.5]) == [1, 2, 3]


def test_a_large_error_counts_against_a_view() -> None:
    assert chosen([0] * 3, place([0, 40, 50]), 2, errors=[0.0, 0.0, 1.0]) == [0, 1]


def test_landmarks_are_treated_each_for_itself() -> None:
    rng = np.random.default_rng(0)
    count = rng.integers(1, 12, 50)
    landmark = np.repeat(np.sort(rng.choice(500, 50, replace=False)), count)
    places, errors = rng.normal(size=(len(landmark), 4)), rng.uniform(0, 2, len(landmark))
    together = sample_farthest(landmark, places, errors, 4, 0.5)
    for one in np.unique(landmark):
        rows = landmark == one
        alone = sample_farthest(landmark[rows], places[rows], errors[rows], 4, 0.5)
        np.testing.assert_array_equal(together[rows], alone)
        assert 1 <= alone.sum() <= 4
        kept = places[rows][alone]
        gaps = np.linalg.norm(kept[:, None] - kept[None], axis=2)[~np.eye(len(kept), dtype=bool)]
        assert (gaps > 0.5).all()


def test_what_hardly_differs_is_left_out() -> None:
    assert chosen([0] * 4, place([0, 0, 0.5, 30]), 8, least=0.1) == [0, 3]
    assert chosen([0] * 2, place([5, 5]), 8) == [0]
    assert chosen([], place([]), 8) == []
