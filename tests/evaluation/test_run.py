"""A run, as a folder, a solution or bare poses, against a truth."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solutions import make_solution
from trajectories import random_walk, trajectory

from vgps.crs import coordinate_system
from vgps.crs.frames import poses_in_system
from vgps.errors import RunFolderError, TrajectoryError
from vgps.evaluation import evaluate
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import GeodeticPoint
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Trajectory
from vgps.writers.run_folder import write_run
from vgps.writers.tum import write_tum

ORIGIN = GeodeticPoint(49.011, 8.4165, 163.0)
OTHER = GeodeticPoint(49.02, 8.43, 150.0)


def write_run_folder(run: Path, poses: Trajectory, **changes: object) -> None:
    run.mkdir()
    write_tum(poses, run / "poses.tum")
    summary = {"world_origin": ORIGIN._asdict(), "camera_p_antenna": [0.0, 0.0, 2.0], "georeferenced": True}
    (run / "solution.json").write_text(json.dumps({**summary, **changes}))


def test_a_run_folder_is_evaluated_with_its_lever_arm(tmp_path: Path) -> None:
    truth = trajectory([0.0, 0.1], [[0, 0, 0], [1, 0, 0]])
    write_tum(truth, tmp_path / "truth.tum")
    tipped = Rotation.from_euler("x", [[90.0], [90.0]], degrees=True)
    write_run_folder(tmp_path / "run", trajectory([0.0, 0.1], [[0, 0, 0], [1, 0, 0]], tipped))
    found = evaluate(tmp_path / "run", tmp_path / "truth.tum")
    np.testing.assert_allclose(found.antenna_error_m, [[0.0, -2.0, -2.0]] * 2, atol=1e-9)
    assert found.camera_position_m.max == 0.0
    assert found.notes == ()
    assert found.nees is None


def test_rig_beside_the_truth_gives_its_clock(tmp_path: Path) -> None:
    poses = random_walk(2)
    write_tum(Trajectory(poses.t_s + 10.0, poses.world_T_camera), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", poses)
    with pytest.raises(TrajectoryError, match=r"truth\.tum: the estimate covers .*video_start_s"):
        evaluate(tmp_path / "run", tmp_path / "truth.tum")
    (tmp_path / "rig.yaml").write_text("video_start_s: 10.0\n")
    found = evaluate(tmp_path / "run", tmp_path / "truth.tum")
    assert found.every_frame_posed
    assert found.camera_position_m.max < 1e-8


def test_truth_with_another_origin_is_converted_and_noted(tmp_path: Path) -> None:
    poses = random_walk(3)
    position = to_enu(OTHER, *to_geodetic(ORIGIN, poses.world_T_camera[:, :3, 3]).T)
    truth = trajectory(poses.t_s, position, Rotation.from_matrix(poses.world_T_camera[:, :3, :3]))
    write_tum(truth, tmp_path / "truth.tum")
    (tmp_path / "rig.yaml").write_text(f"world_origin: [{', '.join(map(str, OTHER))}]\n")
    write_run_folder(tmp_path / "run", poses)
    found = evaluate(tmp_path / "run", tmp_path / "truth.tum")
    assert found.camera_position_m.max < 1e-6
    # the two ENU frames are turned against each other by both differences of angle, to first order
    turned_deg = np.hypot(
        OTHER.latitude_deg - ORIGIN.latitude_deg, OTHER.longitude_deg - ORIGIN.longitude_deg
    )
    assert found.rotation_deg.mean == pytest.approx(turned_deg, rel=1e-3)
    assert "not the run's" in found.notes[0]


def test_a_run_that_is_not_georeferenced_is_noted(tmp_path: Path) -> None:
    write_tum(random_walk(4), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", random_walk(4), georeferenced=False, world_origin=None)
    assert "not georeferenced" in evaluate(tmp_path / "run", tmp_path / "truth.tum").notes[0]


def test_sigmas_are_read_from_poses_csv(tmp_path: Path) -> None:
    write_tum(trajectory([0.0, 0.1], [[0, 0, 0], [0, 0, 0]]), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", trajectory([0.0, 0.1], [1, 1, 1]))
    header = "t_s,sigma_east_m,sigma_north_m,sigma_up_m\n"
    (tmp_path / "run/poses.csv").write_text(header + "0.0,1,1,1\n0.1,,,\n")
    found = evaluate(tmp_path / "run", tmp_path / "truth.tum").nees
    assert found is not None
    assert (found.mean, found.frames) == (pytest.approx(3.0), 1)
    (tmp_path / "run/poses.csv").write_text(header + "0.0,1,1,1\n")
    assert evaluate(tmp_path / "run", tmp_path / "truth.tum").nees is None


def test_damaged_run_or_truth_is_an_error_that_names_the_file(tmp_path: Path) -> None:
    write_tum(random_walk(5), tmp_path / "truth.tum")
    write_run_folder(tmp_path / "run", random_walk(5))
    (tmp_path / "bad.tum").write_text("0.0 1 2 three 0 0 0 1\n")
    with pytest.raises(TrajectoryError, match=r"bad\.tum"):
        evaluate(tmp_path / "run", tmp_path / "bad.tum")
    with pytest.raises(TrajectoryError, match=r"absent\.tum"):
        evaluate(tmp_path / "run", tmp_path / "absent.tum")
    with pytest.raises(RunFolderError, match="not a folder"):
        evaluate(tmp_path / "absent", tmp_path / "truth.tum")
    (tmp_path / "run/solution.json").write_text('{"world_origin": null, "georeferenced": true}')
    with pytest.raises(RunFolderError, match=r"solution\.json: is damaged \('camera_p_antenna'\)"):
        evaluate(tmp_path / "run", tmp_path / "truth.tum")
    (tmp_path / "run/poses.tum").unlink()
    with pytest.raises(RunFolderError, match=r"poses\.tum: is missing"):
        evaluate(tmp_path / "run", tmp_path / "truth.tum")


def test_a_recorded_truth_has_no_error_against_itself(data_dir: Path, tmp_path: Path) -> None:
    recording = data_dir / "kitti03_shake"
    truth = read_trajectory(recording / "truth.tum")
    write_run_folder(tmp_path / "run", Trajectory(truth.t_s - 10.0, truth.world_T_camera))
    found = evaluate(tmp_path / "run", recording / "truth.tum")
    assert (found.frames_matched, found.every_frame_posed) == (300, True)
    assert found.camera_position_m.max < 1e-8
    assert found.rotation_deg.max < 1e-5
    assert found.notes == ()


def test_a_solution_is_evaluated_as_its_run_folder(tmp_path: Path) -> None:
    path = random_walk(6)
    solution = make_solution(path.t_s, path.world_T_camera, world_origin=ORIGIN, camera_p_antenna=np.ones(3))
    write_run(solution, tmp_path / "run")
    write_tum(random_walk(7), tmp_path / "truth.tum")
    (tmp_path / "rig.yaml").write_text(f"world_origin: [{', '.join(map(str, OTHER))}]\n")
    from_memory = evaluate(solution, tmp_path / "truth.tum")
    from_folder = evaluate(str(tmp_path / "run"), str(tmp_path / "truth.tum"))
    np.testing.assert_allclose(from_memory.antenna_error_m, from_folder.antenna_error_m, atol=1e-6)
    assert from_memory.nees is not None and from_folder.nees is not None
    assert from_memory.nees.mean == pytest.approx(from_folder.nees.mean)
    assert from_memory.notes == from_folder.notes != ()


def test_bare_poses_have_no_sigmas_and_the_antenna_in_the_camera() -> None:
    poses = random_walk(8)
    moved = poses.world_T_camera.copy()
    moved[:, :3, 3] += [0.0, 3.0, 4.0]
    found = evaluate(Trajectory(poses.t_s, moved), poses)
    assert found.camera_position_m.mean == found.antenna_position_m.mean == pytest.approx(5.0)
    assert found.nees is None and found.notes == ()


def test_the_tolerance_limits_which_frames_match() -> None:
    poses = random_walk(9)
    late = Trajectory(poses.t_s + 0.03, poses.world_T_camera)
    assert evaluate(late, poses).frames_matched == 40  # by default half of 0.1 s
    with pytest.raises(TrajectoryError, match=r"^the estimate covers .* at most 0\.02 s apart"):
        evaluate(late, poses, tolerance_s=0.02)


def test_a_truth_in_a_projected_system_with_heights_above_a_geoid(tmp_path: Path) -> None:
    poses = random_walk(5)
    write_run_folder(tmp_path / "run", poses)
    system = coordinate_system(ORIGIN[:2], "EPSG:32632", "egm96")
    write_tum(
        Trajectory(poses.t_s, poses_in_system(system, ORIGIN, poses.world_T_camera)), tmp_path / "truth.tum"
    )
    found = evaluate(tmp_path / "run", tmp_path / "truth.tum", crs="EPSG:32632", geoid="egm96")
    assert found.camera_position_m.max < 1e-4 and found.rotation_deg.max < 1e-4
    assert found.notes[0].startswith("the truth is in WGS 84 / UTM zone 32N (EPSG:32632), height above the g")
    # without the geoid, the truth is as much too low
    off = evaluate(tmp_path / "run", tmp_path / "truth.tum", crs="EPSG:32632")
    assert off.camera_vertical_m is not None and 47.0 < off.camera_vertical_m.mean < 49.0
    with pytest.raises(TrajectoryError, match="a geoid without a coordinate system"):
        evaluate(tmp_path / "run", tmp_path / "truth.tum", geoid="egm96")
