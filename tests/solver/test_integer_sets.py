import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.model import IntArray
from vgps.solver.integer_sets import distinct, numbered

NUMBERS = st.lists(st.one_of(st.integers(-40, 40), st.integers(-(2**63), 2**63 - 1)), max_size=60)


@pytest.mark.slow
@given(NUMBERS)
def test_the_integers_are_those_of_numpy(given_numbers: list[int]) -> None:
    numbers = np.array(given_numbers, dtype=np.int64)
    expected, index = np.unique(numbers, return_inverse=True)
    np.testing.assert_array_equal(distinct(numbers), expected)
    found, own = numbered(numbers)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(own, index)


@pytest.mark.parametrize("numbers", [np.array([7, 5, 7, 9]), np.array([3]), np.array([0, 2**40])])
def test_every_integer_is_at_its_index(numbers: IntArray) -> None:
    found, index = numbered(numbers)
    assert found.tolist() == sorted(set(numbers.tolist()))
    np.testing.assert_array_equal(found[index], numbers)
