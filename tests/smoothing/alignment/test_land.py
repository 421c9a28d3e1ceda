import numpy as np
import pytest

from vgps.smoothing.alignment.land import land_normal

RNG = np.random.default_rng(0)
TILTED = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])  # world_R_map
CENTRES = np.array([[0.0, 0.0, 40.0], [30.0, 0.0, 40.0]]) @ TILTED  # in the map


def field(slope=0.0, count=400):
    x, y = RNG.uniform(-20, 50, count), RNG.uniform(-30, 30, count)
    return np.column_stack([x, y, slope * y + RNG.normal(scale=0.3, size=count)])


def houses(count=100):
    return RNG.uniform([-20, -30, 0], [50, 30, 12], (count, 3))


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_the_land_is_the_plane_of_most_landmarks_and_its_normal_points_to_the_camera(slope):
    points = np.vstack([field(slope), houses(), np.full((50, 3), np.nan)]) @ TILTED
    normal = TILTED @ land_normal(points, CENTRES)
    np.testing.assert_allclose(normal, np.array([0.0, -slope, 1.0]) / np.hypot(slope, 1.0), atol=0.02)


def beside_a_road(count=400):
    return RNG.normal(0, [30.0, 1.0, 1.0], (count, 3))


@pytest.mark.parametrize(
    "points", [houses(400), beside_a_road(), field(count=25), np.full((80, 3), np.nan), np.ones((80, 3))]
)
def test_a_cloud_a_row_few_landmarks_and_a_single_place_are_no_land(points):
    assert land_normal(points @ TILTED, CENTRES) is None
