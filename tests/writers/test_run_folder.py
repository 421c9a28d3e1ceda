"""The run folder: what is in it, that it comes back as it was, and that it appears whole or not at all."""

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from run_files import assert_same, bytes_of, rows
from solutions import on_a_rig

from vgps.errors import RunFolderError
from vgps.model import FocalChanges
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Landmarks, Observations, Solution
from vgps.writers.run_folder import FILES, write_run


def test_a_run_comes_back_as_it_was_written(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    assert_same(read_run(tmp_path / "run"), solution)


def test_a_run_without_gps_and_without_landmarks_comes_back_too(solution: Solution, tmp_path: Path) -> None:
    nothing = np.zeros(0, dtype=np.int64)
    bare = dataclasses.replace(
        solution,
        world_origin=None,
        georeferenced=False,
        gps=None,
        fixes=None,
        landmarks=Landmarks(np.zeros((0, 3)), np.zeros(0), np.zeros(0, dtype=np.uint8)),
        observations=Observations(nothing, nothing, np.zeros((0, 2))),
    )
    write_run(bare, tmp_path / "run")
    assert_same(read_run(tmp_path / "run"), bare)
    assert rows(tmp_path / "run/gps.csv") == []
    first = rows(tmp_path / "run/poses.csv")[0]
    assert [first[key] for key in ("latitude_deg", "longitude_deg", "height_m", "heading_deg")] == [""] * 4


def test_a_run_of_a_rig_comes_back_with_the_poses_of_every_camera(solution: Solution, tmp_path: Path) -> None:
    rig, run = on_a_rig(solution), tmp_path / "run"
    write_run(rig, run)
    assert_same(read_run(run), rig)
    poses = read_trajectory(run / "cameras/rear/poses.tum").world_T_camera
    np.testing.assert_allclose(poses, solution.world_T_camera @ rig.cameras[0].reference_T_camera, atol=1e-6)
    summary = json.loads((run / "solution.json").read_text("utf-8"))
    assert summary["schema_versions"]["cameras/rear/poses.tum"] == 1
    assert summary["counts"]["landmarks"] == 2 * len(solution.landmarks.sigma_px)
    assert summary["cameras"][0]["reference_p_camera"] == [0.0, 0.0, -0.2]
    write_run(solution, run)  # of one camera, in its place
    assert not (run / "cameras").exists()


def test_a_run_of_a_camera_that_zooms_comes_back_with_the_changes(solution: Solution, tmp_path: Path) -> None:
    changes = FocalChanges((0.0, 1.5), (-0.01, 0.02), (320.0, 240.5))
    left = dataclasses.replace(changes, log_ratio=(0.001, -0.002))
    camera = dataclasses.replace(solution.camera, focal_changes=changes)
    run = dataclasses.replace(
        solution, camera=camera, sensors=dataclasses.replace(solution.sensors, focal_changes=left)
    )
    write_run(run, tmp_path / "zoom")
    found = read_run(tmp_path / "zoom")
    assert (found.camera, found.sensors.focal_changes) == (camera, left)
    file = tmp_path / "zoom" / "solution.json"
    summary = json.loads(file.read_text(encoding="utf-8"))
    summary["camera"]["focal_changes"]["t_s"] = [1.5, 0.0]
    file.write_text(json.dumps(summary), encoding="utf-8")
    with pytest.raises(RunFolderError, match="ascending t_s"):
        read_run(tmp_path / "zoom")


def test_every_file_has_a_schema_version(solution: Solution, tmp_path: Path) -> None:
    run = tmp_path / "run"
    write_run(solution, run)
    summary = json.loads((run / "solution.json").read_text("utf-8"))
    assert summary["schema_version"] == 1
    assert summary["schema_versions"] == dict.fromkeys(FILES, 1)
    with np.load(run / "measurements.npz") as archive:
        assert archive["schema_version"] == 1
    assert b"\ncomment vgps schema version 1\n" in (run / "points.ply").read_bytes()


def test_the_folder_holds_the_contract_and_nothing_else(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "new/run")
    assert {path.name for path in (tmp_path / "new/run").iterdir()} == set(FILES)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["run"]


def test_solution_json_is_strict_json_and_sums_the_run_up(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    summary = json.loads((tmp_path / "run/solution.json").read_text("utf-8"), parse_constant=refuse)
    assert summary["counts"] == {
        "frames": 4,
        "frames_tracked": 3,
        "frames_bridged": 1,
        "landmarks": 3,
        "observations": 4,
        "submaps": 2,
        "loops": 0,
        "frames_with_static_regions": 2,
        "frames_with_moving_regions": 1,
        "fixes": 2,
        "fixes_used": 1,
        "fixes_unused": 1,
    }
    assert summary["static_share"] == pytest.approx(0.5)
    assert summary["moving_share"] == pytest.approx(0.25)
    assert summary["energy"]["before"] == {"terms": {"video": 12.5, "gps": 3.0}, "total": 15.5}
    assert summary["energy"]["after"]["terms"] == {"video": 1.25, "gps": None}
    assert summary["world_origin"]["height_m"] == 163.0
    assert summary["camera_p_antenna"] == [0.05, -0.93, -0.32]
    assert summary["seconds"] == {"tracking": 1.5, "batch": 0.25}
    assert summary["versions"]["gtsam"][0].isdigit()
    assert yaml.safe_load((tmp_path / "run/config.yaml").read_text("utf-8")) == solution.config


def test_equal_solutions_give_equal_bytes(
    solution: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_run(solution, tmp_path / "a")
    monkeypatch.setattr("time.time", lambda: 2e9)
    write_run(dataclasses.replace(solution, seconds={"tracking": 99.0}), tmp_path / "b")
    a, b = bytes_of(tmp_path / "a"), bytes_of(tmp_path / "b")
    assert [name for name in a if a[name] != b[name]] == ["solution.json"]
    with zipfile.ZipFile(tmp_path / "b/measurements.npz") as archive:
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
