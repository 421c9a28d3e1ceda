from dataclasses import replace

import numpy as np
import pytest

from vgps.config import DriftConfig
from vgps.smoothing.drift import _Path, bend_path
from vgps.smoothing.fixes import Fixes

FRAMES = 200
T_S = 0.1 * np.arange(FRAMES)


def path(t_s):
    return np.stack([20 * np.sin(t_s / 5), 5 * t_s, 0.1 * t_s], axis=1)


@pytest.fixture
def fixes():
    t_s = np.arange(0.05, 19.0)
    n = len(t_s)
    return Fixes(
        t_s, path(t_s), np.full(n, 0.5), np.full(n, 0.7), np.full((n, 3), np.nan), np.ones(n, dtype=bool)
    )


def poses(centres):
    out = np.tile(np.eye(4), (len(centres), 1, 1))
    out[:, :3, 3] = centres
    return out


def drifting():
    steps = np.diff(path(T_S), axis=0) * (1 + np.linspace(0, 0.4, FRAMES - 1))[:, None]
    return poses(np.vstack([path(T_S)[:1], path(T_S)[0] + np.cumsum(steps, axis=0)]))


def away(bent):
    return np.linalg.norm(bent[:, :3, 3] - path(T_S), axis=1)


def test_forty_percent_of_scale_drift_is_taken_out(fixes):
    assert away(drifting()).mean() > 5.0
    bent, scale = bend_path(drifting(), T_S, fixes, np.zeros(3), DriftConfig())
    assert away(bent).mean() < 0.5
    assert scale[5] == pytest.approx(1.0, abs=0.1) and scale[-5] == pytest.approx(1 / 1.4, abs=0.1)


def test_one_wild_fix_bends_nothing(fixes):
    wild = fixes.world_p_fix.copy()
    wild[9] += [40.0, 0.0, 0.0]
    bent, _ = bend_path(poses(path(T_S)), T_S, replace(fixes, world_p_fix=wild), np.zeros(3), DriftConfig())
    assert away(bent).max() < 0.3


def test_jacobian_is_the_residuals(fixes):
    of = _Path(drifting(), T_S, fixes, np.zeros(3), DriftConfig())
    parameters = np.random.default_rng(0).normal(0, 1e-4, 3 + 4 * of.knots)
    numerical = np.stack(
        [
            (of.residual(parameters + 1e-6 * e, 3.0) - of.residual(parameters - 1e-6 * e, 3.0)) / 2e-6
            for e in np.eye(len(parameters))
        ],
        axis=1,
    )
    found = of.jacobian(parameters, 3.0)
    np.testing.assert_allclose(found, numerical, atol=1e-3 * np.abs(numerical).max())
