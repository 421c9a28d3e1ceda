"""Constants of receivers' errors pooled over receivers, and judged on the one that is left out."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from scripts.experiments import receiver_priors
from scripts.experiments.receiver_priors import (
    LEAST_SPREAD,
    log_likelihood,
    pool,
    pooled_without,
    stated_factors,
)
from vgps.model import FixClass
from vgps.survey import ErrorSeries, Memory

FIX, FLOAT, DGPS, SINGLE = FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.DGPS, FixClass.SINGLE
CONSTANTS = np.array([2.448, 3.92, 0.01, 0.1, 1.0, 2.0, 60.0])


def series(t_s: list[float], error_m: np.ndarray, sigma_m: float = np.nan) -> ErrorSeries:
    return ErrorSeries(
        t_s=np.array(t_s),
        error_m=error_m,
        sigma_m=np.full(error_m.shape, sigma_m),
        fix_class=(FLOAT,) * len(t_s),
        source=Path("log.pos"),
    )


def test_receivers_are_pooled_by_their_logarithms():
    found = pool([CONSTANTS, 4 * CONSTANTS])
    np.testing.assert_allclose(found.mean, 2 * CONSTANTS)
    np.testing.assert_allclose(found.spread, np.log(4) / np.sqrt(2))
    np.testing.assert_allclose(pool([CONSTANTS]).spread, LEAST_SPREAD)


def test_a_receiver_left_out_gets_its_class_from_others_or_one_like_it():
    own = {("a", FLOAT): CONSTANTS, ("b", FLOAT): 2 * CONSTANTS, ("a", SINGLE): CONSTANTS}
    own |= {("b", DGPS): 3 * CONSTANTS, ("a", FIX): CONSTANTS}
    np.testing.assert_allclose(pooled_without("a", FLOAT, own).mean, 2 * CONSTANTS)
    np.testing.assert_allclose(pooled_without("a", SINGLE, own).mean, 3 * CONSTANTS)
    assert pooled_without("a", FIX, own) is None


def test_stated_sigmas_beside_actual_errors():
    errors = series([0.0, 1.0], np.zeros((2, 3)), sigma_m=0.5)
    np.testing.assert_allclose(stated_factors(errors, CONSTANTS), [2.0, 4.0])


def test_the_first_error_is_of_the_region_and_others_are_changes():
    error = np.array([[1.0, 0.0, 2.0], [1.1, 0.0, 2.0], [1.1, 0.2, 2.1], [0.0, 0.0, 0.0]])
    found = log_likelihood(series([0.0, 1.0, 2.0, 9.0], error), CONSTANTS)
    memory = Memory(noise_m=0.01, walk_m=0.1, tail=1.0, vertical=2.0)
    region = norm.logpdf(error / [1.0, 1.0, 2.0]).sum(axis=1) - np.log(2.0)
    np.testing.assert_allclose(found[[0, 3]], region[[0, 3]])
    np.testing.assert_allclose(found[1:3], memory.log_density(1.0, error[1:3] - error[:2]))


@pytest.mark.slow
def test_what_others_show_holds_better_than_stated_sigmas(data_dir, tmp_path, monkeypatch, capsys):
    out = tmp_path / "priors.json"
    monkeypatch.setattr(sys, "argv", ["receiver_priors", "--data", str(data_dir), "--json", str(out)])
    receiver_priors.main()
    assert "| pooled over 3 | rtk_float |" in capsys.readouterr().out
    rows = [row for row in json.loads(out.read_text())["rows"] if row["table"] == "left_out"]
    floats = [row for row in rows if row["fix_class"] == "rtk_float"]
    assert len(floats) == 3
    assert all(row["memory_of_others"] > row["stated_sigmas"] + 5.0 for row in floats)
    assert all(row["memory_own"] > row["memory_of_others"] for row in rows)
