from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, X
from synthetic_bundle import K, drive

from vgps.solver.cost import cost_terms, reprojection_errors, robust_loss, robust_weight, whitened_robust_k
from vgps.solver.gtsam_export import to_graph
from vgps.solver.problem import BundleProblem


def one_point(world_p: list[float], uv: list[float], **more: object) -> BundleProblem:
    arrays = {
        "world_T_camera": np.eye(4)[None],
        "world_p_landmark": np.array([world_p]),
        "frame": np.array([0]),
        "landmark": np.array([0]),
        "uv_px": np.array([uv]),
        "sigma_px": np.array([2.0]),
    }
    return BundleProblem(K=K, **(arrays | more))


def test_projection_by_hand() -> None:
    # (1, 2, 4): u = 500 / 4 + 320 = 445, v = 510 * 2 / 4 + 240 = 495
    errors, behind = reprojection_errors(one_point([1.0, 2.0, 4.0], [440.0, 498.0]))
    np.testing.assert_allclose(errors, [[5.0, -3.0]])
    assert not behind[0]


def test_camera_turned_and_moved() -> None:
    world_T_camera = gtsam.Pose3(gtsam.Rot3.Ry(np.pi / 2), np.array([1.0, 0.0, 0.0])).matrix()
    # the camera looks along world x; 3 m ahead, 1 m towards world -z, which is its right
    errors, _ = reprojection_errors(
        one_point([4.0, 0.0, -1.0], [320.0, 240.0], world_T_camera=world_T_camera[None])
    )
    np.testing.assert_allclose(errors, [[500.0 / 3.0, 0.0]], atol=1e-9)


@pytest.mark.parametrize("z", [-3.0, 0.0])
def test_behind_the_camera_costs_what_gtsam_says(z: float) -> None:
    problem = one_point([1.0, 2.0, z], [440.0, 498.0])
    errors, behind = reprojection_errors(problem)
    np.testing.assert_array_equal(errors, [[1000.0, 1000.0]])
    assert behind[0]
    assert cost_terms(problem)["video"] == pytest.approx(0.5 * 2 * 500.0**2)


@pytest.mark.parametrize(("robust", "estimator"), [("huber", "Huber"), ("cauchy", "Cauchy")])
def test_losses_are_those_of_gtsam(robust: str, estimator: str) -> None:
    distance = np.array([0.0, 0.3, 1.0, 1.345, 2.0, 50.0])
    k = np.array([1.0, 2.0, 0.5, 1.345, 1.5, 3.0])
    problem = one_point([0.0, 0.0, 1.0], [0.0, 0.0])
    n = len(k)
    problem = replace(
        problem,
        frame=np.zeros(n, dtype=int),
        landmark=np.zeros(n, dtype=int),
        uv_px=np.zeros((n, 2)),
        sigma_px=np.ones(n),
        robust=robust,
        robust_k=k,
    )
    models = [getattr(gtsam.noiseModel.mEstimator, estimator).Create(constant) for constant in k]
    loss = [model.loss(d) for model, d in zip(models, distance, strict=True)]
    weight = [model.weight(d) for model, d in zip(models, distance, strict=True)]
    np.testing.assert_allclose(robust_loss(problem, distance**2), loss, rtol=1e-14)
    np.testing.assert_allclose(robust_weight(problem, distance**2), weight, rtol=1e-14)
    plain = replace(problem, robust_k=np.full(n, np.inf))
    np.testing.assert_array_equal(robust_loss(plain, distance**2), 0.5 * distance**2)
    np.testing.assert_array_equal(robust_weight(plain, distance**2), 1.0)


def test_the_robust_constant_means_pixels_whatever_the_scaling() -> None:
    # error of 6 px at a pixel sigma of 2: three sigmas; Huber's weight at k = 1.5 is one half
    for scaling in (1.0, 7.0):
        sigma = np.array([2.0 * scaling])
        k = whitened_robust_k(1.5, np.array([2.0]), sigma)
        problem = one_point([0.0, 0.0, 1.0], [0.0, 0.0], sigma_px=sigma, robust="huber", robust_k=k)
        assert robust_weight(problem, (6.0 / sigma) ** 2) == pytest.approx([0.5])


@pytest.mark.parametrize("robust", ["none", "huber", "cauchy"])
def test_graph_has_the_same_cost(robust: str) -> None:
    problem, _ = drive(frames=12, landmarks=60, outliers=0.1)
    k = np.where(problem.landmark % 3 == 0, np.inf, 1.0 + 0.1 * (problem.landmark % 5))
    points = problem.world_p_landmark.copy()
    points[5] = [0.0, 0.0, -50.0]  # behind every camera
    problem = replace(problem, robust=robust, robust_k=k, world_p_landmark=points)
    graph, values = to_graph(problem)
    terms = cost_terms(problem)
    assert reprojection_errors(problem)[1].any()
    assert sum(terms.values()) == pytest.approx(graph.error(values), rel=1e-13)
    assert terms["poses"] == pytest.approx(problem.pose_graph.error(values), rel=1e-13)


def test_graph_holds_fixed_frames_and_leaves_out_what_nothing_mentions() -> None:
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


def test_frames_of_pose_factors() -> None:
    problem, _ = drive(frames=12, landmarks=20)
    np.testing.assert_array_equal(problem.pose_graph_frames, np.arange(12))
    wrong = gtsam.NonlinearFactorGraph()
    wrong.addPriorPoint3(L(0), np.zeros(3), gtsam.noiseModel.Unit.Create(3))
    with pytest.raises(ValueError, match="pose factor"):
        _ = replace(problem, pose_graph=wrong).pose_graph_frames


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"uv_px": np.zeros((2, 2))}, "uv_px"),
        ({"frame": np.array([1])}, "frame 1..1"),
        ({"landmark": np.array([-1])}, "landmark -1..-1"),
        ({"sigma_px": np.array([0.0])}, "sigma_px"),
        ({"robust": "huber"}, "robust_k"),
        ({"fixed": np.zeros(3, dtype=bool)}, "fixed"),
    ],
)
def test_what_does_not_fit_is_told(change: dict[str, object], name: str) -> None:
    with pytest.raises(ValueError, match=name):
        one_point([0.0, 0.0, 1.0], [0.0, 0.0], **change)
