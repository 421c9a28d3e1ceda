from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from synthetic_fixes import T_S, drifting, fixes_at, path, trajectory

from vgps.config import DriftConfig
from vgps.gps.drift_model import DriftModel, Loss

ANTENNA = np.array([0.1, -0.3, 0.2])
ALL = np.ones(19, dtype=bool)


def flexible(start, fixes, time_offset_sigma_s=1.0, attached=False, tilt_sigma_rad=np.inf):
    return DriftModel(start, fixes, np.zeros(3), DriftConfig(), time_offset_sigma_s, attached, tilt_sigma_rad)


@pytest.mark.parametrize("attached", [False, True])
@pytest.mark.parametrize("time_offset_sigma_s", [0.0, 0.5])
@pytest.mark.parametrize("tilt_sigma_rad", [np.inf, 2e-3])
def test_a_banded_step_is_that_of_the_dense_equations(attached, time_offset_sigma_s, tilt_sigma_rad):
    rng = np.random.default_rng(0)
    t_s = np.sort(rng.uniform(-0.2, 20.1, 40))
    fixes = fixes_at(t_s, 0.5, 0.7, offset=rng.normal(0.0, 0.5, (40, 3)))
    of = flexible(drifting(), fixes, time_offset_sigma_s, attached, tilt_sigma_rad)
    parameters = rng.normal(0, 1e-4, len(of.start))
    parameters[3] *= time_offset_sigma_s > 0.0
    loss = Loss(of.regions(), rng.random(40) < 0.8, 3.0)
    J = np.stack(
        [
            (of.offsets(parameters + 1e-6 * e) - of.offsets(parameters - 1e-6 * e)) / 2e-6
            for e in np.eye(len(parameters))
        ],
        axis=2,
    )
    if not time_offset_sigma_s:
        J[:, :, 3] = 0.0
    offset = of.offsets(parameters)
    weight = loss.rows / (1.0 + np.sum((offset / loss.region_m) ** 2, axis=1) / 9.0)
    weight *= np.append(1.0, np.minimum(np.diff(t_s), 1.0))
    scale = np.sqrt(weight)[:, None] / loss.region_m
    change = np.diff(np.eye(of.knots), axis=0, prepend=np.zeros((int(attached), of.knots)))
    walk = np.zeros((4 * len(change), len(parameters)))
    walk[:, 4:] = np.kron(change, np.eye(4)) / of._sigma.ravel()[:, None]
    held = np.zeros((6, len(parameters)))
    held[:3, :3] = attached * np.eye(3) / 1e-3
    held[3, 3] = 1.0 / (time_offset_sigma_s or 1.0)
    held[4:, 5:7] = np.eye(2) / tilt_sigma_rad
    A = np.concatenate([(J * scale[:, :, None]).reshape(-1, len(parameters)), walk, held])
    b = np.concatenate([(offset * scale).ravel(), walk @ parameters, held @ parameters])
    expected = -np.linalg.lstsq(A, b, rcond=None)[0]
    step = of._step(of._at(parameters), loss)
    np.testing.assert_allclose(step, expected, atol=2e-3 * np.abs(expected[4:]).max())


def test_many_fixes_a_second_count_as_one():
    def cost(interval_s):
        t_s = np.arange(0.0, 19.0, interval_s)
        of = flexible(
            trajectory(path(T_S)), fixes_at(t_s, 0.5, 0.7, offset=np.tile([0.9, 0.0, 0.0], (len(t_s), 1)))
        )
        return of.cost(of.start, np.ones(len(t_s), dtype=bool), of.regions())

    assert cost(0.01) == pytest.approx(cost(1.0), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("attached", [False, True])
def test_the_fit_is_the_minimum_that_scipy_finds(attached):
    rng = np.random.default_rng(1)
    fixes = fixes_at(np.arange(0.05, 19.0), 0.5, 0.7, offset=rng.normal(0, 0.5, (19, 3)))
    of = flexible(drifting(0.1), fixes, attached=attached)
    loss = Loss(of.regions(), ALL, 3.0)

    def residual(parameters):
        away2 = np.sum((of.offsets(parameters) / loss.region_m) ** 2, axis=1)
        knots = parameters[4:].reshape(-1, 4)
        change = np.diff(knots, axis=0, prepend=np.zeros((1 if attached else 0, 4))) / of._sigma
        held = parameters[:3] / 1e-3 if attached else np.zeros(3)
        away = 3.0 * np.sqrt(np.log1p(away2 / 9.0))
        return np.concatenate([away, change.ravel(), parameters[3:4], held])

    ours = of.fit(of.fit_coarse_to_fine(ALL, 0.3), loss)
    reference = least_squares(residual, ours, xtol=1e-9, ftol=1e-9, max_nfev=25)
    assert of._cost(of._at(ours), loss) == pytest.approx(2.0 * reference.cost, rel=2e-3)


@pytest.mark.slow
def test_a_fit_reaches_the_minimum_from_afar():
    """From a radian away steps that raise the cost are shortened, and one step is not enough."""
    rng = np.random.default_rng(4)
    fixes = fixes_at(np.arange(0.05, 19.0), 0.5, 0.7, offset=rng.normal(0, 0.5, (19, 3)))
    of = flexible(drifting(0.1), fixes)
    minimum = of.refine(of.fit_coarse_to_fine(ALL, 0.3), ALL, of.regions())
    least = of.cost(minimum, ALL, of.regions())
    for away in rng.normal(0.0, 1.0, (40, len(minimum))):
        found = of.refine(minimum + away, ALL, of.regions())
        assert of.cost(found, ALL, of.regions()) == pytest.approx(least, rel=1e-2)


@pytest.mark.parametrize("time_offset_s", [-0.4, 0.37])
def test_turns_determine_the_time_offset(time_offset_s):
    t_s = np.arange(1.05, 18.0)
    fixes = fixes_at(t_s - time_offset_s, 0.5, 0.7)
    stamped = replace(fixes, t_s=t_s)
    of = flexible(trajectory(path(T_S)), stamped)
    rows = np.ones(len(t_s), dtype=bool)
    parameters = of.refine(of.fit_coarse_to_fine(rows, 0.1), rows, of.regions())
    assert of.time_offset_s(parameters) == pytest.approx(time_offset_s, abs=0.02)


def test_a_straight_path_at_constant_speed_leaves_the_time_offset_undetermined():
    fixes = fixes_at(np.arange(0.05, 19.0), 0.5, 0.7)
    straight = np.stack([0 * T_S, 5 * T_S, 0 * T_S], axis=1)
    on_it = np.stack([0 * fixes.t_s, 5 * fixes.t_s, 0 * fixes.t_s], axis=1)
    fixes = replace(fixes, world_p_fix=on_it)
    of = flexible(trajectory(straight), fixes)
    # fixes 0.37 s late lie 1.85 m behind, which a shift of the start explains as well
    of = flexible(trajectory(straight), replace(fixes, t_s=fixes.t_s + 0.37))
    parameters = of.refine(of.start, ALL, of.regions())
    assert abs(of.time_offset_s(parameters)) < 0.05
    np.testing.assert_allclose(of.offsets(parameters), 0.0, atol=0.01)


def test_without_a_prior_the_time_offset_is_held():
    fixes = fixes_at(np.arange(0.05, 19.0), 0.5, 0.7)
    of = flexible(drifting(), fixes, time_offset_sigma_s=0.0)
    assert of.time_offset_s(of.fit_coarse_to_fine(ALL, 0.3)) == 0.0
