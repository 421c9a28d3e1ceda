from dataclasses import replace

import gtsam
import numpy as np
import pytest
from synthetic_bundle import drive, one_point, with_loss

from vgps.solver.cost import (
    cost_terms,
    observation_costs,
    reprojection_errors,
    robust_loss,
    robust_weight,
    video_cost,
    whitened_robust_k,
)


def test_projection_computed_by_hand() -> None:
    # (1, 2, 4): u = 500 / 4 + 320 = 445, v = 510 * 2 / 4 + 240 = 495
    errors, behind = reprojection_errors(one_point([1.0, 2.0, 4.0], [440.0, 498.0]))
    np.testing.assert_allclose(errors, [[5.0, -3.0]])
    assert not behind[0]


def test_projection_into_a_rotated_and_translated_camera() -> None:
    world_T_camera = gtsam.Pose3(gtsam.Rot3.Ry(np.pi / 2), np.array([1.0, 0.0, 0.0])).matrix()
    # the camera looks along world x; 3 m ahead, 1 m towards world -z, which is its right
    errors, _ = reprojection_errors(
        one_point([4.0, 0.0, -1.0], [320.0, 240.0], world_T_camera=world_T_camera[None])
    )
    np.testing.assert_allclose(errors, [[500.0 / 3.0, 0.0]], atol=1e-9)


@pytest.mark.parametrize("z", [-3.0, 0.0])
def test_landmark_behind_the_camera_costs_what_gtsam_says(z: float) -> None:
    problem = one_point([1.0, 2.0, z], [440.0, 498.0])
    errors, behind = reprojection_errors(problem)
    np.testing.assert_array_equal(errors, [[1000.0, 1000.0]])
    assert behind[0]
    assert cost_terms(problem)["video"] == pytest.approx(0.5 * 2 * 500.0**2)


@pytest.mark.parametrize(("robust", "estimator"), [("huber", "Huber"), ("cauchy", "Cauchy")])
def test_losses_and_weights_equal_those_of_gtsam(robust: str, estimator: str) -> None:
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


def test_robust_constant_acts_in_pixels_at_any_weight() -> None:
    # error of 6 px at a pixel sigma of 2: three sigmas; Huber's weight at k = 1.5 is one half
    for scaling in (1.0, 7.0):
        sigma = np.array([2.0 * scaling])
        k = whitened_robust_k(1.5, np.array([2.0]), sigma)
        problem = one_point([0.0, 0.0, 1.0], [0.0, 0.0], sigma_px=sigma, robust="huber", robust_k=k)
        assert robust_weight(problem, (6.0 / sigma) ** 2) == pytest.approx([0.5])


def test_cost_of_an_observation_is_its_loss() -> None:
    # errors of 5 and -3 px at a sigma of 2 px: 34 / 4 / 2
    problem = one_point([1.0, 2.0, 4.0], [440.0, 498.0])
    np.testing.assert_allclose(observation_costs(problem), [34.0 / 8.0])
    # Huber with k = 1 at a whitened length of sqrt(34) / 2
    np.testing.assert_allclose(observation_costs(with_loss(problem, "huber")), [np.sqrt(34.0) / 2.0 - 0.5])


def test_a_large_problem_is_taken_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = with_loss(drive(frames=12, landmarks=60)[0], "cauchy")
    errors, behind = reprojection_errors(problem)
    costs = observation_costs(problem)
    monkeypatch.setattr("vgps.solver.cost._AT_ONCE", 100)
    assert len(problem.frame) > 200 and len(problem.frame) % 100
    found, found_behind = reprojection_errors(problem)
    np.testing.assert_array_equal(found, errors)
    np.testing.assert_array_equal(found_behind, behind)
    np.testing.assert_array_equal(observation_costs(problem), costs)


def test_cost_has_a_term_for_the_video_and_one_for_the_pose_factors() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    terms = cost_terms(problem)
    assert set(terms) == {"video", "poses"}
    assert terms["video"] == video_cost(problem) == pytest.approx(observation_costs(problem).sum())
    without = cost_terms(replace(problem, pose_graph=gtsam.NonlinearFactorGraph()))
    assert without == {"video": terms["video"], "poses": 0.0} and terms["poses"] > 0.0
