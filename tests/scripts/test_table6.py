import pytest

from scripts.experiments.kume_table6.table import (
    THESIS,
    AntennaError,
    antenna_errors,
    as_markdown,
    ratios_to_gaussians,
)
from vgps.compare import METHODS

A, B, C, D, CYLINDER, CAUCHY = (method.name for method in METHODS)


def row(**means: float) -> dict[str, AntennaError]:
    names = {"b": B, "c": C, "d": D, "cylinder": CYLINDER, "cauchy": CAUCHY}
    return {names[key]: AntennaError(mean, 0.5 * mean, 2.0 * mean) for key, mean in means.items()}


def test_the_thesis_s_ratios_are_those_it_claims():
    found = {(one.method, one.base): one for one in ratios_to_gaussians([THESIS])}
    assert found[CYLINDER, C].of_means == pytest.approx(0.45, abs=0.005)
    assert found[CYLINDER, B].of_means == pytest.approx(0.23, abs=0.005)
    assert all(one.of_means == pytest.approx(one.thesis) for one in found.values()) and len(found) == 4


def test_ratios_of_several_seeds():
    rows = [row(c=1.0, cylinder=0.5), row(c=3.0, cylinder=0.6)]
    (only,) = ratios_to_gaussians(rows)
    assert only.of_means == pytest.approx(1.1 / 4.0)
    assert only.each == (pytest.approx(0.5), pytest.approx(0.2))


def test_a_table_says_means_ranges_and_the_thesis_s():
    text = as_markdown([row(c=1.0, cylinder=0.5, cauchy=0.7), row(c=3.0, cylinder=0.6, cauchy=0.9)])
    assert (
        f"| {C} | 2.000 (1.000-3.000) | 1.000 (0.500-1.500) | 4.000 (2.000-6.000) | 0.895 / 0.582 / 1.681 |"
        in text
    )
    assert f"| {CAUCHY} | 0.800 (0.700-0.900) |" in text and A not in text
    assert f"| {CYLINDER} to {C} | 0.28 (0.20-0.50) | 0.45 |" in text


def test_one_seed_has_no_range():
    assert f"| {CYLINDER} to {C} | 0.50 | 0.45 |" in as_markdown([row(c=1.0, cylinder=0.5)])


def test_errors_are_the_antenna_s():
    class Spread:
        mean, std, max = 1.0, 2.0, 3.0

    class Evaluation:
        antenna_position_m = Spread()

    class Comparison:
        evaluations = {"x": Evaluation()}  # noqa: RUF012

    assert antenna_errors(Comparison()) == {"x": AntennaError(1.0, 2.0, 3.0)}  # type: ignore[arg-type]
