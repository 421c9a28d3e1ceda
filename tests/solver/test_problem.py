from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import B, L, O, X
from synthetic_bundle import drive, one_point
from synthetic_states import drive_with_states

from vgps.solver.gtsam_values import all_pose_values, pose_values
from vgps.solver.state_vectors import StateVector


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
def test_inconsistent_arrays_are_refused(change: dict[str, object], name: str) -> None:
    with pytest.raises(ValueError, match=name):
        one_point([0.0, 0.0, 1.0], [0.0, 0.0], **change)


def test_frames_of_keys_in_any_order() -> None:
    problem, _ = drive(frames=3, landmarks=20)
    named = replace(problem, pose_keys=np.array([70, 10, 40]), pose_graph=gtsam.NonlinearFactorGraph())
    np.testing.assert_array_equal(named.frames_of([10, 40, 70]), [1, 2, 0])
    with pytest.raises(ValueError, match="key 11 belongs to no pose"):
        named.frames_of([11])


def test_selected_observations_have_no_pose_factors() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    rows = np.array([5, 2, 9])
    part = problem.select_observations(rows)
    np.testing.assert_array_equal(part.uv_px, problem.uv_px[rows])
    np.testing.assert_array_equal(part.sigma_px, problem.sigma_px[rows])
    assert part.pose_graph.size() == 0
    np.testing.assert_array_equal(part.world_T_camera, problem.world_T_camera)


def test_moved_changes_the_state_and_leaves_the_original() -> None:
    problem, poses = drive(frames=12, landmarks=60)
    start = problem.world_T_camera.copy()
    moved = problem.moved(poses, problem.world_p_landmark + 1.0, {5: np.ones(1)})
    np.testing.assert_array_equal(moved.world_T_camera, poses)
    np.testing.assert_array_equal(moved.shared[5], [1.0])
    np.testing.assert_array_equal(problem.world_T_camera, start)
    with pytest.raises(ValueError, match="world_p_landmark has shape"):
        problem.moved(poses, problem.world_p_landmark[1:])


def test_values_of_poses_with_factors_and_of_all_poses() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    graph = gtsam.NonlinearFactorGraph()
    graph.addPriorPose3(X(4), gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6))
    problem = replace(problem, pose_graph=graph, shared={5: np.array([0.5])})
    assert list(pose_values(problem).keys()) == [5, X(4)]
    values = all_pose_values(problem)
    assert values.size() == 13
    np.testing.assert_array_equal(values.atPose3(X(7)).matrix(), problem.world_T_camera[7])


@pytest.mark.parametrize(
    ("state", "message"),
    [
        (StateVector(np.zeros(7), 0), r"state o0 has shape \(7,\), expected \(d,\) with d of 1..6"),
        (StateVector(np.zeros((2, 2)), 0), "state o0 has shape"),
        (StateVector(np.zeros(3), 4), "frame of a state 4..4, expected 0..3"),
    ],
)
def test_states_of_wrong_size_or_place_are_refused(state: StateVector, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(drive(frames=4, landmarks=20)[0], states={O(0): state})


@pytest.mark.parametrize("key", [X(1), 5])
def test_state_with_a_key_in_use_is_refused(key: int) -> None:
    problem = replace(drive(frames=4, landmarks=20)[0], shared={5: np.zeros(1)})
    with pytest.raises(ValueError, match="belongs to a state and to another"):
        replace(problem, states={key: StateVector(np.zeros(3), 0)})


def test_states_have_values_move_and_are_left_out_of_a_selection() -> None:
    problem = drive_with_states()
    assert pose_values(problem).atVector(B(1)).shape == (1,)
    np.testing.assert_array_equal(problem.pose_graph_frames, np.arange(40))
    states = {key: state.moved(state.vector + 1.0) for key, state in problem.states.items()}
    moved = problem.moved(problem.world_T_camera, problem.world_p_landmark, states=states)
    np.testing.assert_array_equal(all_pose_values(moved).atVector(O(3)), np.ones(3))
    assert moved.states[O(3)].frame == 15 and moved.shared is problem.shared
    assert not np.any(problem.states[O(3)].vector)
    assert problem.select_observations(np.arange(3)).states == {}
