import numpy as np
import pytest
from solutions import make_fixes


def test_ratios_are_those_of_sizes_whatever_the_side():
    table = make_fixes(np.zeros((2, 3)), residual_m=np.array([[0.3, 0.4, 1.0], [-0.3, 0.4, -1.0]]))
    for ratio, expected in zip(table.region_ratios, (5.0, 10.0), strict=True):
        assert ratio == pytest.approx(expected)
