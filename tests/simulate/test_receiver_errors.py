from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vgps.errors import ConfigError, GpsLogError
from vgps.model import FixClass
from vgps.simulate import (
    SCENES,
    FixErrors,
    GpsConfig,
    build_motion,
    scene_with_errors,
)
from vgps.simulate.receiver_errors import fit_gauss_markov, replay
from vgps.simulate.sensor_config import FIX_ERRORS
from vgps.simulate.sensors import gauss_markov, simulate_fixes
from vgps.survey import ErrorSeries, read_errors

FIX, FLOAT = FixClass.RTK_FIX, FixClass.RTK_FLOAT
WALK = SCENES["walk"]


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def series(count: int, fix_class: FixClass = FLOAT, step_s: float = 1.0) -> ErrorSeries:
    """East counts the epochs, north is minus that, up is 100; the receiver says 0.5, 0.6, 0.7 m."""
    east = np.arange(float(count))
    error = np.column_stack([east, -east, np.full(count, 100.0)])
    sigma = np.tile([0.5, 0.6, 0.7], (count, 1))
    return ErrorSeries(
        t_s=step_s * east,
        error_m=error,
        sigma_m=sigma,
        fix_class=(fix_class,) * count,
        source=Path("rover.pos"),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("sigma", "time_s"), [(0.7, 8.0), (2.5, 40.0)])
def test_a_process_is_recovered(sigma: float, time_s: float) -> None:
    error = gauss_markov(
        40_000, 1.0, FixErrors(sigma_h_m=sigma, sigma_v_m=sigma, correlation_s=time_s), rng()
    )
    for axis in range(3):
        found = fit_gauss_markov(np.arange(40_000.0), error[:, axis])
        assert found.sigma_m == pytest.approx(sigma, rel=0.1)
        assert found.correlation_s == pytest.approx(time_s, rel=0.2)


@pytest.mark.slow
def test_gaps_and_other_intervals_do_not_matter() -> None:
    t = 0.2 * np.arange(100_000)
    error = gauss_markov(len(t), 0.2, FixErrors(sigma_h_m=1.0, sigma_v_m=1.0, correlation_s=5.0), rng())[:, 0]
    kept = rng(1).random(len(t)) < 0.6
    found = fit_gauss_markov(t[kept], error[kept])
    assert found.sigma_m == pytest.approx(1.0, rel=0.1) and found.correlation_s == pytest.approx(5.0, rel=0.2)


@pytest.mark.slow
def test_the_relative_sigma_is_the_scatter_of_short_logs() -> None:
    model = FixErrors(sigma_h_m=1.0, sigma_v_m=1.0, correlation_s=20.0)
    fits = [
        fit_gauss_markov(np.arange(600.0), gauss_markov(600, 1.0, model, rng(k))[:, 0]) for k in range(60)
    ]
    scatter = np.std([fit.sigma_m for fit in fits])
    assert 0.5 < np.median([fit.sigma_doubt for fit in fits]) / scatter < 1.5


def test_a_bias_counts_and_never_ends() -> None:
    found = fit_gauss_markov(np.arange(100.0), np.full(100, -2.0))
    assert found.sigma_m == 2.0 and found.correlation_s > 90 and found.sigma_doubt > 0.5


def test_a_replay_begins_somewhere_and_goes_on() -> None:
    error, said = replay(series(10), np.array([0.03, 1.03, 2.53]), rng())
    steps = np.diff(error[:, 0]) % 10
    np.testing.assert_allclose(steps[:1], 1.0)
    np.testing.assert_allclose(error[:, 2], 100.0)
    np.testing.assert_allclose(said, [[0.5, 0.6, 0.7]] * 3)
    begins = {float(replay(series(10), np.array([5.0]), rng(seed))[0][0, 0]) for seed in range(60)}
    assert begins == set(np.arange(10.0))


def test_a_replay_keeps_the_log_s_own_pace() -> None:
    t = np.arange(0.0, 1.0, 0.25)
    error, _ = replay(series(50, step_s=0.5), t, rng(4))
    np.testing.assert_allclose(np.diff(error[:, 0]), 0.5)


def test_a_simulated_receiver_replays_the_classes_that_its_log_has() -> None:
    config = replace(WALK, gps=GpsConfig(replay=series(100)))
    fixes = simulate_fixes(build_motion(config, rng()), config, rng())
    floats = np.array([one is FLOAT for one in fixes.fix_class])
    np.testing.assert_allclose(fixes.error_m[floats, 2], 100.0)
    np.testing.assert_allclose(fixes.reported_m[floats], np.tile([0.5, 0.6, 0.7], (floats.sum(), 1)))
    assert np.abs(fixes.error_m[~floats]).max() < 0.2
    np.testing.assert_allclose(fixes.reported_m[~floats][0], FIX_ERRORS[FIX].reported_m)


def test_unknown_sigmas_of_the_log_are_the_models() -> None:
    silent = replace(series(100), sigma_m=np.full((100, 3), np.nan))
    config = replace(WALK, gps=GpsConfig(replay=silent))
    fixes = simulate_fixes(build_motion(config, rng()), config, rng())
    claimed = {tuple(row) for row in fixes.reported_m}
    assert claimed == {FIX_ERRORS[FIX].reported_m, FIX_ERRORS[FLOAT].reported_m}


@pytest.mark.slow
def test_the_defaults_are_those_of_a_real_receiver(data_dir: Path) -> None:
    own = read_errors(data_dir / "survey/stationary.nmea").of_class(FLOAT)
    fits = [fit_gauss_markov(own.t_s, own.error_m[:, axis]) for axis in range(3)]
    model = FIX_ERRORS[FLOAT]
    for fit, total in zip(fits, model.total_m, strict=True):
        assert abs(fit.sigma_m - total) < 2 * fit.sigma_doubt * total
    assert np.mean([fit.correlation_s for fit in fits]) == pytest.approx(model.correlation_s, rel=0.3)


def test_a_reference_alone_is_refused() -> None:
    with pytest.raises(ConfigError, match="reference without a log"):
        scene_with_errors("walk", None, Path("b.pos"))


def test_a_file_that_is_not_a_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.nmea").write_text("nothing\n")
    with pytest.raises(GpsLogError, match=r"x\.nmea: not a GPS log of a known format"):
        scene_with_errors("walk", tmp_path / "x.nmea")
