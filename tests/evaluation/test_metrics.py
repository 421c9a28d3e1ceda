"""Errors against a truth: by hand, against evo, and from a run folder."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from vgps.errors import RunFolderError, TrajectoryError
from vgps.evaluation import align, as_json, as_table, evaluate, evaluate_run, match, table
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import FloatArray, GeodeticPoint
from vgps.solution import Trajectory
from vgps.writers.tum import write_tum

NO_LEVER = np.zeros(3)
ORIGIN = GeodeticPoint(49.011, 8.4165, 163.0)
OTHER = GeodeticPoint(49.02, 8.43, 150.0)


def trajectory(t_s: object, position: object, rotation: Rotation | None = None) -> Trajectory:
    times = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    poses[:, :3, 3] = position
    if rotation is not None:
        poses[:, :3, :3] = rotation.as_matrix()
    return Trajectory(times, poses)


def wandering(seed: int, frames: int = 40) -> Trajectory:
    rng = np.random.default_rng(seed)
    position = np.cumsum(rng.normal(size=(frames, 3)), axis=0)
    return trajectory(np.arange(frames) / 10, position, Rotation.random(frames, random_state=rng))


def rendered(renderable: Table) -> str:
    console = Console(file=io.StringIO(), width=160)
    console.print(renderable)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_an_offset_is_split_into_horizontal_and_vertical() -> None:
    times = np.arange(5) / 10
    found = evaluate(trajectory(times, [3.0, 4.0, -12.0]), trajectory(times, [0.0, 0.0, 0.0]), NO_LEVER)
    assert found.camera_position_m.mean == found.camera_position_m.max == 13.0
    assert found.camera_horizontal_m.rmse == 5.0
    assert found.camera_vertical_m.median == 12.0
    assert found.antenna_position_m == found.camera_position_m
    np.testing.assert_array_equal(found.camera_error_m, [[3.0, 4.0, -12.0]] * 5)
    assert found.rotation_deg.max == 0.0


def test_the_antenna_turns_with_the_camera() -> None:
    quarter = Rotation.from_euler("z", [[90.0]], degrees=True)
    found = evaluate(
        trajectory(0.0, [0, 0, 0], quarter), trajectory(0.0, [0, 0, 0]), np.array([1.0, 0.0, 2.0])
    )
    assert found.camera_position_m.max == 0.0
    np.testing.assert_allclose(found.antenna_error_m, [[-1.0, 1.0, 0.0]], atol=1e-12)
    assert found.antenna_horizontal_m.mean == pytest.approx(np.sqrt(2))
    assert found.rotation_deg.mean == pytest.approx(90.0)


def test_statistics_by_hand() -> None:
    times = np.arange(3.0)
    found = evaluate(
        trajectory(times, [[0, 0, 0], [3, 0, 0], [0, 0, -4]]), trajectory(times, [0, 0, 0]), NO_LEVER
    )
    spread = found.camera_position_m
    assert spread.mean == pytest.approx(7 / 3)
    assert spread.median == 3.0
    assert spread.rmse == pytest.approx(np.sqrt(25 / 3))
    assert spread.std == pytest.approx(np.sqrt(25 / 3 - 49 / 9))  # about the mean, over N
    assert spread.max == 4.0


@given(angle_deg=st.floats(0.0, 180.0), seed=st.integers(0, 100))
def test_the_rotation_error_is_the_angle_between(angle_deg: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    base = Rotation.random(random_state=rng)
    turned = base * Rotation.from_rotvec(np.radians(angle_deg) * axis / np.linalg.norm(axis))
    found = evaluate(trajectory(0.0, [0, 0, 0], turned), trajectory(0.0, [0, 0, 0], base), NO_LEVER)
    assert found.rotation_error_deg[0] == pytest.approx(angle_deg, abs=1e-6)


def test_a_missing_frame_is_counted() -> None:
    truth = wandering(1)
    kept = np.arange(40) != 7
    found = evaluate(Trajectory(truth.t_s[kept], truth.world_T_camera[kept]), truth, NO_LEVER)
    assert (found.frames_estimate, found.frames_truth, found.frames_matched) == (39, 40, 39)
    assert not found.every_frame_posed
    assert evaluate(truth, truth, NO_LEVER).every_frame_posed


def test_frames_are_matched_in_time_and_never_interpolated() -> None:
    estimate = trajectory([0.0, 0.1, 0.2, 0.3], [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    truth = trajectory([0.02, 0.12, 0.22], [[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    found = evaluate(estimate, truth, NO_LEVER)
    assert found.camera_position_m.max == 0.0  # the neighbour's own pose, though 0.02 s away
    assert found.largest_gap_s == pytest.approx(0.02)
    assert found.tolerance_s == pytest.approx(0.05)
    assert found.frames_matched == 3
    with pytest.raises(TrajectoryError, match=r"frames at most 0\.01 s apart"):
        evaluate(estimate, truth, NO_LEVER, tolerance_s=0.01)


def test_match_takes_the_nearest_once() -> None:
    rows, others = match(np.array([0.0, 0.1, 0.2]), np.array([0.21, 0.09, 0.12, 5.0]), 0.05)
    assert rows.tolist() == [1, 2]
    assert others.tolist() == [1, 0]


times = st.lists(st.floats(-100, 100), min_size=1, max_size=30, unique=True).map(np.array)


@given(a=times, b=times, tolerance_s=st.floats(0, 10))
def test_match_pairs_mutual_nearest_neighbours(a: FloatArray, b: FloatArray, tolerance_s: float) -> None:
    rows, others = match(a, b, tolerance_s)
    distance = np.abs(a[:, None] - b)
    assert len(set(rows.tolist())) == len(set(others.tolist())) == len(rows)
    for row, other in zip(rows, others, strict=True):
        assert distance[row, other] == distance[row].min() == distance[:, other].min() <= tolerance_s
    closest = np.unravel_index(np.argmin(distance), distance.shape)
    assert len(rows) > 0 or distance[closest] > tolerance_s


@given(seed=st.integers(0, 1000), scale=st.floats(0.01, 100))
def test_align_undoes_a_similarity(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(10, 3))
    target = scale * Rotation.random(random_state=rng).apply(source) + rng.normal(size=3) * 1000
    similar = align(source, target, with_scale=True)
    assert similar is not None
    assert similar[0] == pytest.approx(scale)
    np.testing.assert_allclose(similar[1], 0.0, atol=1e-9 * max(scale, 1.0) * 1000)
    rigid = align(source, target, with_scale=False)
    assert rigid is not None
    # what a rigid motion leaves of a pure change of scale is that scale's share of the extent
    extent = np.linalg.norm(source - source.mean(axis=0), axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(rigid[1], axis=1), abs(scale - 1) * extent, rtol=1e-6, atol=1e-8
    )


def test_align_never_mirrors() -> None:
    source = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3], [0, 0, 0]])
    rigid = align(source, source * [1, 1, -1], with_scale=False)
    assert rigid is not None
    assert np.linalg.norm(rigid[1]) > 0.5


def test_alignment_is_left_out_where_nothing_determines_it() -> None:
    assert align(np.eye(3)[:2], np.eye(3)[:2], with_scale=False) is None
    assert align(np.zeros((5, 3)), np.eye(5)[:, :3], with_scale=True) is None
    still = evaluate(trajectory(np.arange(5.0), [1, 2, 3]), trajectory(np.arange(5.0), [0, 0, 0]), NO_LEVER)
    assert still.camera_position_after_se3_m is None
    assert still.sim3_scale is None


def test_a_straight_line_can_be_aligned() -> None:
    line = np.outer(np.arange(10.0), [1.0, 2.0, 3.0])
    similar = align(2 * line[:, ::-1] + 5, line, with_scale=True)
    assert similar is not None
    assert similar[0] == pytest.approx(0.5)
    np.testing.assert_allclose(similar[1], 0.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_evo_agrees(seed: int) -> None:
    geometry = pytest.importorskip("evo.core.geometry", reason="evo is the oracle for trajectory metrics")
    from evo.core import metrics
    from evo.core.trajectory import PoseTrajectory3D

    truth, noise = wandering(seed), wandering(seed + 10)
    poses = truth.world_T_camera.copy()
    poses[:, :3, 3] = 1.3 * poses[:, :3, 3] + 0.1 * noise.world_T_camera[:, :3, 3] + 5
    poses[:, :3, :3] = poses[:, :3, :3] @ noise.world_T_camera[0, :3, :3]
    found = evaluate(Trajectory(truth.t_s, poses), truth, NO_LEVER)
    pair = tuple(
        PoseTrajectory3D(poses_se3=list(matrices), timestamps=truth.t_s)
        for matrices in (truth.world_T_camera, poses)
    )
    for relation, ours in (
        (metrics.PoseRelation.translation_part, found.camera_position_m),
        (metrics.PoseRelation.rotation_angle_deg, found.rotation_deg),
    ):
        ape = metrics.APE(relation)
        ape.process_data(pair)
        theirs = ape.get_all_statistics()
        assert {name: theirs[name] for name in ("mean", "median", "rmse", "std", "max")} == pytest.approx(
            {name: getattr(ours, name) for name in ("mean", "median", "rmse", "std", "max")}
        )
    p, q = poses[:, :3, 3], truth.world_T_camera[:, :3, 3]
    for with_scale, ours in (
        (False, found.camera_position_after_se3_m),
        (True, found.camera_position_after_sim3_m),
    ):
        R, t, c = geometry.umeyama_alignment(p.T, q.T, with_scale)
        left = np.linalg.norm(c * p @ R.T + t - q, axis=1)
        assert ours is not None
        assert (ours.mean, ours.max) == pytest.approx((left.mean(), left.max()))
    assert found.sim3_scale == pytest.approx(c)


def test_nees_by_hand() -> None:
    sigma = np.array([[1.0, 2.0, 3.0], [0.5, 1.0, 1.5], [np.nan] * 3])
    estimate = trajectory(np.arange(3.0), [1.0, 2.0, 3.0])
    found = evaluate(estimate, trajectory(np.arange(3.0), [0, 0, 0]), NO_LEVER, sigma_position_m=sigma)
    assert found.nees is not None
    assert found.nees.mean == pytest.approx((3 + 12) / 2)  # one sigma on each axis, then two
    assert found.nees.within_95 == 0.5  # 3 is below 7.81, 12 is not
    assert found.nees.frames == 2


def test_honest_sigmas_have_a_nees_of_three() -> None:
    rng = np.random.default_rng(0)
    sigma = rng.uniform(0.1, 2.0, size=(4000, 3))
    found = evaluate(
        trajectory(np.arange(4000.0), sigma * rng.normal(size=(4000, 3))),
        trajectory(np.arange(4000.0), [0, 0, 0]),
        NO_LEVER,
        sigma_position_m=sigma,
    )
    assert found.nees is not None
    assert found.nees.mean == pytest.approx(3.0, abs=0.15)
    assert found.nees.within_95 == pytest.approx(0.95, abs=0.015)


def test_trajectories_that_cannot_be_compared_are_told() -> None:
    truth = wandering(1)
    with pytest.raises(
        TrajectoryError, match=r"estimate at 100\.000 to 103\.900 s and truth at 0\.000 to 3\.900 s"
    ):
        evaluate(Trajectory(truth.t_s + 100, truth.world_T_camera), truth, NO_LEVER)
    with pytest.raises(TrajectoryError, match="truth has no poses"):
        evaluate(truth, trajectory([], np.zeros((0, 3))), NO_LEVER)
    with pytest.raises(TrajectoryError, match="pose 1: estimate is not finite"):
        evaluate(trajectory([0.0, 0.1], [[0, 0, 0], [np.nan, 0, 0]]), truth, NO_LEVER)


def write_run_folder(run: Path, poses: Trajectory, **changes: object) -> None:
    run.mkdir()
    write_tum(poses, run / "poses.tum")
    summary = {"world_origin": ORIGIN._asdict(), "camera_p_antenna": [0.0, 0.0, 2.0], "georeferenced": True}
    (run / "solution.json").write_text(json.dumps({**summary, **changes}))


def test_a_run_is_evaluated_with_its_own_lever_arm(tmp_path: Path) -> None:
    truth = trajectory([0.0, 0.1], [[0, 0, 0], [1, 0, 0]])
    write_tum(truth, tmp_path / "truth.tum")
    tipped = Rotation.from_euler("x", [[90.0], [90.0]], degrees=True)
    write_run_folder(tmp_path / "run", trajectory([0.0, 0.1], [[0, 0, 0], [1, 0, 0]], tipped))
    found = evaluate_run(tmp_path / "run", tmp_path / "truth.tum")
    np.testing.assert_allclose(found.antenna_error_m, [[0.0, -2.0, -2.0]] * 2, atol=1e-9)
    assert found.camera_position_m.max == 0.0
    assert found.notes == ()
    assert found.nees is None


def test_the_rig_beside_the_truth_says_on_which_clock_it_is(tmp_path: Path) -> None:
    poses = wandering(2)
    write_tum(Trajectory(poses.t_s + 10.0, poses.world_T_camera), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", poses)
    with pytest.raises(TrajectoryError, match=r"truth\.tum: estimate at .*video_start_s"):
        evaluate_run(tmp_path / "run", tmp_path / "truth.tum")
    (tmp_path / "rig.yaml").write_text("video_start_s: 10.0\n")
    found = evaluate_run(tmp_path / "run", tmp_path / "truth.tum")
    assert found.every_frame_posed
    assert found.camera_position_m.max < 1e-8


def test_a_truth_in_another_world_is_carried_over_and_noted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    poses = wandering(3)
    position = to_enu(OTHER, *to_geodetic(ORIGIN, poses.world_T_camera[:, :3, 3]).T)
    truth = trajectory(poses.t_s, position, Rotation.from_matrix(poses.world_T_camera[:, :3, :3]))
    write_tum(truth, tmp_path / "truth.tum")
    (tmp_path / "rig.yaml").write_text(f"world_origin: [{', '.join(map(str, OTHER))}]\n")
    write_run_folder(tmp_path / "run", poses)
    found = evaluate_run(tmp_path / "run", tmp_path / "truth.tum")
    assert found.camera_position_m.max < 1e-6
    # the two ENU frames are turned against each other by both differences of angle, to first order
    turned_deg = np.hypot(
        OTHER.latitude_deg - ORIGIN.latitude_deg, OTHER.longitude_deg - ORIGIN.longitude_deg
    )
    assert found.rotation_deg.mean == pytest.approx(turned_deg, rel=1e-3)
    assert "not the run's" in found.notes[0]
    assert "not the run's" in caplog.text


def test_a_run_without_a_world_is_noted(tmp_path: Path) -> None:
    write_tum(wandering(4), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", wandering(4), georeferenced=False, world_origin=None)
    assert "not georeferenced" in evaluate_run(tmp_path / "run", tmp_path / "truth.tum").notes[0]


def test_sigmas_come_from_poses_csv(tmp_path: Path) -> None:
    write_tum(trajectory([0.0, 0.1], [[0, 0, 0], [0, 0, 0]]), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", trajectory([0.0, 0.1], [1, 1, 1]))
    header = "t_s,sigma_east_m,sigma_north_m,sigma_up_m\n"
    (tmp_path / "run/poses.csv").write_text(header + "0.0,1,1,1\n0.1,,,\n")
    found = evaluate_run(tmp_path / "run", tmp_path / "truth.tum").nees
    assert found is not None
    assert (found.mean, found.frames) == (pytest.approx(3.0), 1)
    (tmp_path / "run/poses.csv").write_text(header + "0.0,1,1,1\n")
    assert evaluate_run(tmp_path / "run", tmp_path / "truth.tum").nees is None


def test_a_broken_run_or_truth_is_told(tmp_path: Path) -> None:
    write_tum(wandering(5), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", wandering(5))
    (tmp_path / "bad.tum").write_text("0.0 1 2 three 0 0 0 1\n")
    with pytest.raises(TrajectoryError, match=r"bad\.tum"):
        evaluate_run(tmp_path / "run", tmp_path / "bad.tum")
    with pytest.raises(TrajectoryError, match=r"absent\.tum"):
        evaluate_run(tmp_path / "run", tmp_path / "absent.tum")
    with pytest.raises(RunFolderError, match="is no folder"):
        evaluate_run(tmp_path / "absent", tmp_path / "truth.tum")
    (tmp_path / "run/poses.tum").unlink()
    with pytest.raises(RunFolderError, match=r"poses\.tum: is missing"):
        evaluate_run(tmp_path / "run", tmp_path / "truth.tum")
    (tmp_path / "run/solution.json").write_text('{"world_origin": null, "georeferenced": true}')
    with pytest.raises(RunFolderError, match=r"solution\.json: is damaged \('camera_p_antenna'\)"):
        evaluate_run(tmp_path / "run", tmp_path / "truth.tum")


def test_json_has_units_in_its_names_and_no_nan() -> None:
    found = as_json(evaluate(wandering(6), wandering(7), NO_LEVER))
    assert set(found["camera_position_m"]) == {"mean", "median", "rmse", "std", "max"}
    assert found["every_frame_posed"] is True
    assert found["nees"] is None
    assert "camera_error_m" not in found
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_the_table_shows_every_error_and_how_frames_were_matched() -> None:
    times = np.arange(5) / 10
    text = rendered(
        as_table(evaluate(trajectory(times, [3, 4, -12]), trajectory(times, [0, 0, 0]), NO_LEVER))
    )
    (row,) = [line for line in text.splitlines() if "camera position [m]" in line]
    assert row.count("13.000") == 4  # mean, median, rmse, max
    assert "5 of 5 frames of the truth matched, every frame posed" in text
    assert "SE3" not in text


def test_several_runs_stand_side_by_side() -> None:
    truth = wandering(8)
    shift = np.array([[0, 0, 0, 0.5]] * 3 + [[0, 0, 0, 0]])
    moved = Trajectory(truth.t_s[:-1], truth.world_T_camera[:-1] + shift)
    text = rendered(
        table([("truth", evaluate(truth, truth, NO_LEVER)), ("moved [b]", evaluate(moved, truth, NO_LEVER))])
    )
    (row,) = [line for line in text.splitlines() if "moved [b]" in line]
    assert "39/40" in row
    assert f"{np.sqrt(3) / 2:.3f}" in row


def test_a_real_truth_against_itself_is_exact(data_dir: Path, tmp_path: Path) -> None:
    from vgps.readers.trajectory import read_trajectory

    recording = data_dir / "kitti03_shake"
    truth = read_trajectory(recording / "truth.tum")
    write_run_folder(tmp_path / "run", Trajectory(truth.t_s - 10.0, truth.world_T_camera))
    found = evaluate_run(tmp_path / "run", recording / "truth.tum")
    assert (found.frames_matched, found.every_frame_posed) == (300, True)
    assert found.camera_position_m.max < 1e-8
    assert found.rotation_deg.max < 1e-5
    assert found.notes == ()
