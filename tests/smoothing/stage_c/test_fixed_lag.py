"""The fixed-lag smoother with named factors, on a chain of points whose marginals are exact."""

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L

from vgps.smoothing.stage_c.fixed_lag import FixedLagGraph, GraphChange

STEP = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
FIX = gtsam.noiseModel.Isotropic.Sigma(3, 0.5)
MEASURED = np.random.default_rng(0).normal(0.0, 0.5, (12, 3)) + np.arange(12.0)[:, None]


def link(k):
    """Changes that add point k: a step of 1 from the one before, and a fix."""
    factors = {("fix", k): gtsam.PriorFactorPoint3(L(k), MEASURED[k], FIX)}
    if k:
        factors["step", k] = gtsam.BetweenFactorPoint3(L(k - 1), L(k), np.ones(3), STEP)
    values = gtsam.Values()
    values.insert(L(k), np.zeros(3))
    return GraphChange(factors=factors, values=values, stamps={L(k): float(k)})


def batch(left_out=()):
    """The whole chain at its minimum."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k in range(12):
        change = link(k)
        values.insert(change.values)
        for name, factor in change.factors.items():
            if name not in left_out:
                graph.push_back(factor)
    return gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()


def smoothed(lag=3.0):
    graph = FixedLagGraph(lag, {"l": np.full(3, 1e-3)})
    for k in range(12):
        estimate = graph.update(link(k), 3)
    return graph, estimate


def test_what_has_left_stays_as_a_prior():
    graph, estimate = smoothed()
    values = batch()
    assert estimate.size() == 4 and L(8) in graph and L(7) not in graph
    for k in range(8, 12):
        np.testing.assert_allclose(estimate.atPoint3(L(k)), values.atPoint3(L(k)), atol=1e-6)


def test_a_factor_leaves_by_its_name_until_a_variable_of_it_has_left():
    graph, _ = smoothed()
    assert set(graph.names()) == {*(("fix", k) for k in range(8, 12)), *(("step", k) for k in range(9, 12))}
    estimate = graph.update(GraphChange(removed={("fix", 10)}), 3)
    values = batch(left_out={("fix", 10)})
    assert ("fix", 10) not in graph.names()
    np.testing.assert_allclose(estimate.atPoint3(L(11)), values.atPoint3(L(11)), atol=1e-6)
    with pytest.raises(KeyError):
        graph.update(GraphChange(removed={("fix", 2)}), 1)


def test_a_variable_without_factors_is_indeterminate():
    graph, _ = smoothed()
    values = gtsam.Values()
    values.insert(L(12), np.zeros(3))
    values.insert(L(13), np.zeros(3))
    loose = {("step", 13): gtsam.BetweenFactorPoint3(L(12), L(13), np.ones(3), STEP)}
    with pytest.raises(RuntimeError, match="Indeterminate"):
        graph.update(GraphChange(factors=loose, values=values, stamps={L(12): 12.0, L(13): 13.0}), 1)
