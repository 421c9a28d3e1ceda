"""The engine with several cameras on a rig against GTSAM, whose projection factors know their place."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam_steps import check_first_step
from synthetic_bundle import TIGHT, total_cost, with_loss
from synthetic_rigs import REAR, REAR_K, rig_drive
from synthetic_rows import path_error

from vgps.solver.bundle_adjustment import solve
from vgps.solver.cost import reprojection_errors
from vgps.solver.graph_optimiser import optimise_graph
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.mounts import CameraMounts
from vgps.solver.problem import BundleProblem
from vgps.solver.row_times import RowTimes


def with_rows(problem: BundleProblem) -> BundleProblem:
    """Return the problem with observations up to 40 ms from the frames, which come every 0.1 s."""
    delay_s = 0.04 * np.sin(np.arange(len(problem.frame)))
    t_s = 0.1 * np.arange(len(problem.world_T_camera))
    return replace(problem, row_times=RowTimes.of_frames(t_s, problem.frame, delay_s, 1.0))


def test_a_point_is_seen_from_the_cameras_own_place() -> None:
    problem, _ = rig_drive(frames=6, landmarks=40)
    row = int(np.flatnonzero(problem.landmark % 2)[0])
    world_T_rear = problem.world_T_camera[problem.frame[row]] @ REAR
    x, y, z = np.linalg.inv(world_T_rear)[:3] @ np.append(
        problem.world_p_landmark[problem.landmark[row]], 1.0
    )
    fx, fy, cx, cy = REAR_K
    errors, behind = reprojection_errors(problem)
    np.testing.assert_allclose(errors[row] + problem.uv_px[row], [fx * x / z + cx, fy * y / z + cy])
    assert not behind[row]


def test_a_landmark_behind_its_camera_costs_what_it_does_in_gtsam() -> None:
    mounts = CameraMounts(
        camera=np.array([1]), K=np.array([REAR_K] * 2), reference_T_camera=np.stack([np.eye(4), REAR])
    )
    problem = BundleProblem(
        K=REAR_K,
        world_T_camera=np.eye(4)[None],
        world_p_landmark=np.array([[0.0, 0.0, 5.0]]),
        frame=np.array([0]),
        landmark=np.array([0]),
        uv_px=np.zeros((1, 2)),
        sigma_px=np.ones(1),
        mounts=mounts,
    )
    graph, values = to_graph(problem)
    assert total_cost(problem) == pytest.approx(graph.error(values))


@pytest.mark.slow
@pytest.mark.parametrize("rolling", [False, True])
def test_the_linear_system_is_that_of_gtsam(rolling: bool) -> None:
    problem = with_loss(rig_drive(frames=9, landmarks=60)[0], "huber")
    problem = with_rows(problem) if rolling else problem
    graph, values = to_graph(problem)
    assert total_cost(problem) == pytest.approx(graph.error(values), rel=1e-10)
    check_first_step(problem)


@pytest.mark.parametrize("solver", ["schur", "gtsam"])
def test_two_cameras_recover_the_path(solver: str) -> None:
    problem, truth = rig_drive(frames=12, landmarks=80, noise_px=0.0)
    held = np.isin(np.arange(12), [0, 11])
    start = np.where(held[:, None, None], truth, problem.world_T_camera)
    tied = replace(problem, world_T_camera=start, fixed=held, pose_graph=gtsam.NonlinearFactorGraph())
    end = solve(tied, TIGHT, solver)  # type: ignore[arg-type]
    assert end.solver == solver
    assert path_error(end.problem.world_T_camera, truth) < 1e-6


@pytest.mark.slow
def test_gtsams_interface_never_takes_a_rig_for_one_camera() -> None:
    problem, _ = rig_drive(frames=9, landmarks=60)
    graph, values = to_graph(problem)
    result = optimise_graph(graph, values, TIGHT)
    assert result.error_after == pytest.approx(total_cost(solve(problem, TIGHT).problem), rel=1e-6)
