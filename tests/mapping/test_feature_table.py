import numpy as np
from scipy.spatial.transform import Rotation

from vgps.mapping.feature_table import FeatureTable
from vgps.mapping.map_update import Positions, Similarity


def table(count=6):
    """Features 0 .. count - 1 of luminance 10 times their id; all but the first two have positions."""
    made = FeatureTable()
    made.add(10 * np.arange(count))
    ids = np.arange(2, count)
    made.place(Positions(ids, np.stack([ids, -ids, 2 * ids], axis=1).astype(float), 0.1 * ids))
    return made


def test_features_start_without_positions_and_keep_their_luminance():
    made = FeatureTable()
    assert made.add(np.array([5, 6])).tolist() == [0, 1] and made.add(np.array([7])).tolist() == [2]
    assert len(made) == 3 and made.gray.tolist() == [5, 6, 7]
    assert np.isnan(made.points).all() and np.isnan(made.sigma_px).all()


def test_rows_survive_the_growth_of_memory():
    made = table()
    rest = np.full(20_000, 9)
    assert made.add(rest[:10_000])[-1] == 10_005 and made.add(rest)[0] == 10_006
    assert made.points.shape == (30_006, 3)
    np.testing.assert_array_equal(made.points[2:6], table().points[2:6])
    assert made.gray[:6].tolist() == [0, 10, 20, 30, 40, 50] and np.isnan(made.points[6:]).all()


def test_copies_have_position_reliability_and_luminance_of_the_originals():
    made = table()
    new = made.add_copies(np.array([4, 0]))
    assert new.tolist() == [6, 7] and made.gray[6:].tolist() == [40, 0]
    np.testing.assert_array_equal(made.points[6], [4, -4, 8])
    assert made.sigma_px[6] == 0.4 and np.isnan(made.points[7]).all()


def test_a_similarity_moves_every_position():
    made = table()
    made.transform(
        Similarity(2.0, Rotation.from_euler("z", 90, degrees=True).as_matrix(), np.array([1, 0, 0]))
    )
    np.testing.assert_allclose(made.points[3], [7.0, 6.0, 12.0], atol=1e-12)  # (3, -3, 6) turned: (3, 3, 6)
    assert np.isnan(made.points[0]).all() and made.sigma_px[3] == 0.1 * 3


def test_features_dropped_at_the_front_lower_the_ids_of_the_others():
    made = table()
    made.drop_first(3)
    assert len(made) == 3 and made.gray.tolist() == [30, 40, 50]
    np.testing.assert_array_equal(made.points[0], [3, -3, 6])
    assert made.add(np.array([1])).tolist() == [3] and made.gray.tolist() == [30, 40, 50, 1]


def test_a_copy_and_its_original_change_apart():
    made = table()
    twin = made.copy()
    twin.place(Positions(np.array([3]), np.zeros((1, 3)), np.array([9.0])))
    made.add(np.array([1]))
    assert made.points[3, 0] == 3.0 and twin.points[3, 0] == 0.0
    assert len(made) == 7 and len(twin) == 6
