import numpy as np

from vgps.mapping.growing_array import GrowingArray


def test_rows_come_back_in_order_beyond_every_doubling():
    rows = GrowingArray((2,))
    for k in range(1000):
        rows.append([k, -k])
    assert len(rows) == 1000 and rows.values.shape == (1000, 2)
    np.testing.assert_array_equal(rows.values[:, 0], np.arange(1000))
    np.testing.assert_array_equal(rows.values[:, 1], -np.arange(1000))


def test_values_written_to_the_view_are_kept():
    rows = GrowingArray()
    rows.append(1.0)
    rows.values[0] = 7.0
    rows.append(2.0)
    assert rows.values.tolist() == [7.0, 2.0]


def test_given_rows_are_copied_and_can_be_appended_to():
    given = np.arange(600.0).reshape(300, 2)
    rows = GrowingArray.of(given)
    rows.values[0] = 7.0
    assert given[0, 0] == 0.0
    for k in range(400):
        rows.append([k, k])
    assert len(rows) == 700 and rows.values[299, 1] == 599.0 and rows.values[-1, 0] == 399.0
