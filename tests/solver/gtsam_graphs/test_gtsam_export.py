from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import B, L, X
from synthetic_bundle import drive, one_point, through_lens
from synthetic_states import drive_with_states

from vgps.solver.cost import cost_terms, reprojection_errors
from vgps.solver.gtsam_graphs.gtsam_export import to_graph


@pytest.mark.parametrize("lens", [False, True])
@pytest.mark.parametrize("robust", ["none", "huber", "cauchy"])
def test_graph_has_the_cost_of_the_problem(robust: str, lens: bool) -> None:
    problem, _ = drive(frames=12, landmarks=60, outliers=0.1)
    k = np.where(problem.landmark % 3 == 0, np.inf, 1.0 + 0.1 * (problem.landmark % 5))
    points = problem.world_p_landmark.copy()
    points[5] = [0.0, 0.0, -50.0]  # behind every camera
    problem = replace(problem, robust=robust, robust_k=k, world_p_landmark=points)
    problem = through_lens(problem) if lens else problem
    graph, values = to_graph(problem)
    terms = cost_terms(problem)
    assert reprojection_errors(problem)[1].any()
    assert sum(terms.values()) == pytest.approx(graph.error(values), rel=1e-13)
    assert terms["poses"] == pytest.approx(problem.pose_graph.error(values), rel=1e-13)


def test_graph_holds_fixed_frames_and_omits_variables_without_factors() -> None:
    fixed = np.array([True, False])
    problem = one_point(
        [0.0, 0.0, 5.0], [320.0, 240.0], world_T_camera=np.stack([np.eye(4)] * 2), fixed=fixed
    )
    problem = replace(problem, world_p_landmark=np.array([[0.0, 0.0, 5.0], [1.0, 1.0, 1.0]]))
    graph, values = to_graph(problem)
    assert values.exists(X(0)) and values.exists(L(0))
    assert not values.exists(X(1)) and not values.exists(L(1))
    assert graph.size() == 2
    values.update(X(0), gtsam.Pose3(gtsam.Rot3(), np.array([0.0, 0.0, 0.1])))
    assert graph.error(values) == pytest.approx(0.5 * 1000.0 * 0.1**2)  # GTSAM's penalty for moving it


def test_graph_includes_states_as_vectors() -> None:
    problem = drive_with_states()
    graph, values = to_graph(problem)
    assert values.atVector(B(0)).shape == (6,)
    assert sum(cost_terms(problem).values()) == pytest.approx(graph.error(values), rel=1e-13)
