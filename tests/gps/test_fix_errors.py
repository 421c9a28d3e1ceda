import numpy as np
import pytest
from synthetic_fixes import fixes_of_size

from vgps.gps.fix_errors import fix_errors


def test_errors_of_fixes_have_the_size_and_correlation_time_of_their_class():
    n = 400
    t_s = np.arange(n) * 0.5
    r_m, h_m = np.full(n, 2.0), np.full(n, 5.0)
    fixes = fixes_of_size(t_s, np.zeros((n, 3)), r_m, h_m, correlation_s=r_m * 5)
    drawn = fix_errors(fixes, 200, np.random.default_rng(0))
    inside = np.hypot(drawn[:, 0], drawn[:, 1]) < 2.0
    assert inside.mean() == pytest.approx(0.95, abs=0.01)
    assert (np.abs(drawn[:, 2]) < 5.0).mean() == pytest.approx(0.95, abs=0.01)
    # 10 s to both sides: after 5 s it has forgotten all but 1/e
    later = np.mean(drawn[10:] * drawn[:-10], axis=(0, 2)) / np.mean(drawn**2, axis=(0, 2))
    np.testing.assert_allclose(later, np.exp(-1.0), atol=0.05)


def test_an_enlarged_region_keeps_the_correlation_of_errors():
    n = 100
    r_m = np.where(np.arange(n) % 2, 2.0, 3.0 + 0.01 * np.arange(n))  # dilution differs from fix to fix
    size = {"correlation_s": np.full(n, 50.0)}
    fixes = fixes_of_size(np.arange(n) * 0.5, np.zeros((n, 3)), r_m, 2 * r_m, **size)
    drawn = fix_errors(fixes, 300, np.random.default_rng(0)) / r_m[:, None, None]
    neighbours = np.mean(drawn[1:] * drawn[:-1]) / np.mean(drawn**2)
    assert neighbours == pytest.approx(np.exp(-2 * 0.5 / 50.0), abs=0.01)
