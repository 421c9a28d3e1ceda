import gtsam
import numpy as np
import pytest
from synthetic_bundle import drive, one_point, through_lens, total_cost, with_loss

from vgps.solver.cost import camera_points, pixel_errors
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise, linearise_chunk, whitening
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem

over_lenses = pytest.mark.parametrize(
    "filmed", [lambda problem: problem, through_lens], ids=["pinhole", "lens"]
)


@over_lenses
def test_gradient_is_that_of_the_cost_in_gtsams_chart(filmed) -> None:
    problem = filmed(with_loss(drive(frames=8, landmarks=60, outliers=0.1)[0], "cauchy"))
    structure = analyse_sparsity(problem)
    linear = linearise(problem, all_pose_values(problem), structure)
    rng = np.random.default_rng(1)
    for _ in range(5):
        pose_step, point_step = rng.normal(size=(8, 6)), rng.normal(size=(60, 3))

        def cost(
            share: float, pose_step: np.ndarray = pose_step, point_step: np.ndarray = point_step
        ) -> float:
            steps = zip(problem.world_T_camera, share * pose_step, strict=True)
            poses = np.stack([gtsam.Pose3(T).retract(d).matrix() for T, d in steps])
            return total_cost(problem.moved(poses, problem.world_p_landmark + share * point_step))

        slope = linear.gradient @ pose_step.ravel()
        for part in linear.chunks:
            slope += np.sum(part.gradient * point_step[part.chunk.landmarks].T)
        assert slope == pytest.approx((cost(1e-6) - cost(-1e-6)) / 2e-6, rel=1e-5)


def whitened_errors(problem: BundleProblem) -> np.ndarray:
    return pixel_errors(problem, camera_points(problem))[0] / problem.sigma_px


@over_lenses
@pytest.mark.parametrize("depth_m", [0.5, 4.0, 300.0])
def test_jacobians_equal_numerical_ones(depth_m: float, filmed) -> None:
    pose = gtsam.Pose3.Expmap(np.array([0.3, -0.2, 0.5, 1.0, 2.0, 3.0]))
    point = pose.transformFrom(depth_m * np.array([0.4, -0.3, 1.0]))
    problem = filmed(one_point(point.tolist(), [440.0, 498.0], world_T_camera=pose.matrix()[None]))
    part = linearise_chunk(problem, analyse_sparsity(problem).chunks[0])
    np.testing.assert_allclose(part.r, whitened_errors(problem))
    step = 1e-6
    for k, delta in enumerate(step * np.eye(6)):
        ahead, behind = (
            whitened_errors(problem.moved(pose.retract(d).matrix()[None], problem.world_p_landmark))
            for d in (delta, -delta)
        )
        expected = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(part.jp[:, k], expected, rtol=1e-6, atol=1e-6 * np.abs(part.jp).max())
    for k, delta in enumerate(step * np.eye(3)):
        ahead, behind = (
            whitened_errors(problem.moved(problem.world_T_camera, problem.world_p_landmark + d))
            for d in (delta, -delta)
        )
        expected = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(part.jl[:, k], expected, rtol=1e-6, atol=1e-6 * np.abs(part.jl).max())


def test_landmark_behind_the_camera_has_a_residual_and_no_jacobian() -> None:
    problem = one_point([1.0, 2.0, -4.0], [440.0, 498.0])
    part = linearise_chunk(problem, analyse_sparsity(problem).chunks[0])
    np.testing.assert_allclose(part.r, 500.0)  # 2 fx at a sigma of 2 px
    assert not np.any(part.jp) and not np.any(part.jl)


def test_whitening_is_the_root_of_the_weight_over_sigma() -> None:
    # 6 px at a sigma of 2 px are three sigmas, of which Huber's loss with k = 1.5 keeps a weight of one half
    problem = with_loss(one_point([0.0, 0.0, 1.0], [0.0, 0.0]), "huber", 1.5)
    error = np.array([[6.0], [0.0]])
    np.testing.assert_allclose(whitening(problem, error), [np.sqrt(0.5) / 2.0])


@over_lenses
def test_hessian_of_the_poses_is_that_of_gtsam_with_the_landmarks_held(filmed) -> None:
    problem = filmed(drive(frames=8, landmarks=60)[0])
    structure = analyse_sparsity(problem)
    values = all_pose_values(problem)
    linear = linearise(problem, values, structure)
    expected = np.zeros((48, 48))
    for part in linear.chunks:
        for row, frame in enumerate((part.chunk.first_frame + part.chunk.frame).tolist()):
            J, at = part.jp[:, :, row], slice(6 * frame, 6 * frame + 6)
            expected[at, at] += J.T @ J
    ordering = gtsam.Ordering()
    for key in problem.keys.tolist():
        ordering.push_back(key)
    expected += problem.pose_graph.linearize(values).hessian(ordering)[0]
    np.testing.assert_allclose(linear.hessian.toarray(), np.tril(expected), rtol=1e-9, atol=1e-6)
    assert np.all(linear.diagonal > 0)


def test_steps_move_residuals_through_a_lens_as_the_jacobians_say() -> None:
    problem = through_lens(drive(frames=8, landmarks=60)[0])
    part = linearise_chunk(problem, analyse_sparsity(problem).chunks[0])
    step = np.random.default_rng(0).normal(size=(8, 6))
    expected = np.einsum("ian,na->in", part.jp, step[part.chunk.first_frame + part.chunk.frame])
    np.testing.assert_allclose(part.moved_by_poses(step), expected)
