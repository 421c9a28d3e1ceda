"""The run folder: what is in it, that it comes back as it was, and that it appears whole or not at all."""

import csv
import dataclasses
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run
from vgps.solution import FixTable, Landmarks, Observations, Solution
from vgps.writers import run_folder
from vgps.writers.run_folder import FILES, check_writable, write_run


def assert_same(found: Any, expected: Any, where: str = "solution") -> None:
    """Equal types, arrays (with dtype), NaN equal to NaN, down to the leaves."""
    if dataclasses.is_dataclass(expected):
        for item in dataclasses.fields(expected):
            assert_same(getattr(found, item.name), getattr(expected, item.name), f"{where}.{item.name}")
    elif isinstance(expected, np.ndarray):
        assert found.dtype == expected.dtype, where
        np.testing.assert_array_equal(found, expected, err_msg=where)
    elif isinstance(expected, dict):
        assert list(found) == list(expected), where
        for key in expected:
            assert_same(found[key], expected[key], f"{where}[{key}]")
    else:
        assert type(found) is type(expected), where
        assert repr(found) == repr(expected), where  # repr, since NaN is not equal to NaN


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


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


def test_an_older_run_without_the_path_before_the_last_stage_loads(
    solution: Solution, tmp_path: Path
) -> None:
    older = dataclasses.replace(solution, world_p_before=None)
    write_run(older, tmp_path / "run")
    with np.load(tmp_path / "run" / "measurements.npz") as arrays:
        assert "world_p_before" not in arrays.files
    assert_same(read_run(tmp_path / "run"), older)


def test_settings_of_an_older_run_have_their_present_names(solution: Solution, tmp_path: Path) -> None:
    older = {"judge": {"tail_size": 3.0}, "sensors": {"lag_s": 0.1}, "window": {"iterations": 4}}
    write_run(dataclasses.replace(solution, config=older), tmp_path / "run")
    config = read_run(tmp_path / "run").config
    assert config["outliers"] == {"tail_size": 3.0}
    assert config["sensors"] == {"time_offset_s": 0.1}
    assert config["window"] == {"iterations": 4}


def test_a_run_as_version_0_1_wrote_it_loads(solution: Solution, tmp_path: Path) -> None:
    """It has no schema versions."""
    run = tmp_path / "run"
    write_run(solution, run)
    summary = json.loads((run / "solution.json").read_text("utf-8"))
    del summary["schema_version"], summary["schema_versions"]
    (run / "solution.json").write_text(json.dumps(summary), "utf-8")
    with np.load(run / "measurements.npz") as archive:
        arrays = {key: archive[key] for key in archive.files if key != "schema_version"}
    np.savez(run / "measurements.npz", **arrays)
    assert_same(read_run(run), solution)


def test_every_file_has_a_schema_version(solution: Solution, tmp_path: Path) -> None:
    run = tmp_path / "run"
    write_run(solution, run)
    summary = json.loads((run / "solution.json").read_text("utf-8"))
    assert summary["schema_version"] == 1
    assert summary["schema_versions"] == dict.fromkeys(FILES, 1)
    with np.load(run / "measurements.npz") as archive:
        assert archive["schema_version"] == 1
    assert b"\ncomment vgps schema version 1\n" in (run / "points.ply").read_bytes()


@pytest.mark.parametrize(
    ("version", "message"),
    [(2, "schema version 2; expected at most 1; update vgps"), ("new", "key schema_version: 'new'")],
)
@pytest.mark.parametrize("name", ["solution.json", "measurements.npz"])
def test_a_run_of_a_later_schema_is_refused(
    solution: Solution, tmp_path: Path, name: str, version: object, message: str
) -> None:
    file = tmp_path / "run" / name
    write_run(solution, file.parent)
    if name == "solution.json":
        summary = json.loads(file.read_text("utf-8"))
        file.write_text(json.dumps({**summary, "schema_version": version}), "utf-8")
    else:
        with np.load(file) as archive:
            arrays = {key: archive[key] for key in archive.files}
        np.savez(file, **{**arrays, "schema_version": np.array(version)})
    with pytest.raises(RunFolderError, match=f"{name}.*{message}"):
        read_run(file.parent)


def test_the_folder_holds_the_contract_and_nothing_else(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "new/run")
    assert {path.name for path in (tmp_path / "new/run").iterdir()} == set(FILES)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["run"]


def test_poses_tum_keeps_every_frame_to_the_nanometre(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    table = np.loadtxt(tmp_path / "run/poses.tum")
    np.testing.assert_allclose(table[:, 0], solution.t_s, atol=1e-9)
    np.testing.assert_allclose(table[:, 1:4], solution.world_T_camera[:, :3, 3], atol=1e-9)
    rotation = Rotation.from_quat(table[:, 4:]).as_matrix()
    np.testing.assert_allclose(rotation, solution.world_T_camera[:, :3, :3], atol=1e-11)
    assert (table[:, 7] >= 0).all()
    np.testing.assert_allclose(table[0, 4:], [-0.5, 0.5, -0.5, 0.5], atol=1e-12)  # axes east, down, south


def test_poses_csv_says_where_on_the_globe_and_how_sure(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    first, second, _, last = rows(tmp_path / "run/poses.csv")
    assert (first["frame"], first["state"], second["state"]) == ("0", "tracked", "bridged")
    assert float(first["heading_deg"]) == pytest.approx(90.0)  # the optical axis points east
    # 2 m north on the ellipsoid's meridian at 49.011 deg (radius 6 371 881 m), 1 m east on its parallel
    assert float(first["latitude_deg"]) - 49.011 == pytest.approx(2 / 6371881 * 180 / np.pi, rel=1e-4)
    assert float(first["longitude_deg"]) - 8.4165 == pytest.approx(
        1 / (6390338 * np.cos(np.radians(49.011))) * 180 / np.pi, rel=1e-4
    )
    assert float(first["height_m"]) == pytest.approx(166.0, abs=1e-5)
    assert [first[f"sigma_{axis}_m"] for axis in ("east", "north", "up")] == [
        "0.010000",
        "0.020000",
        "0.030000",
    ]
    assert [float(second[f"sigma_rot_{axis}_deg"]) for axis in ("east", "north", "up")] == [4.0, 5.0, 6.0]
    assert last["sigma_up_m"] == ""


def test_gps_csv_gives_each_fix_its_residual_ratio_and_verdict(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    inside, outside = rows(tmp_path / "run/gps.csv")
    assert (inside["line"], inside["class"], inside["used"]) == ("1", "rtk_fix", "yes")
    assert float(inside["ratio_r"]) == pytest.approx(0.5)  # hypot(3 cm, 4 cm) over 10 cm
    assert float(inside["ratio_h"]) == pytest.approx(2.0)  # 10 cm over 5 cm
    assert (inside["residual_north_m"], inside["east_m"]) == ("-0.040000", "0.500000")
    assert (outside["used"], outside["reason"]) == ("no", "outside the video, after its end")
    assert (outside["ratio_r"], outside["height_m"]) == ("", "")


def test_gps_csv_lists_the_fixes_of_a_run_that_did_not_look_at_them(
    solution: Solution, tmp_path: Path
) -> None:
    write_run(dataclasses.replace(solution, fixes=None), tmp_path / "run")
    first, _ = rows(tmp_path / "run/gps.csv")
    assert (first["latitude_deg"], first["used"], first["residual_east_m"]) == ("49.0110000000", "no", "")


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
        "fixes": 2,
        "fixes_used": 1,
        "fixes_unused": 1,
    }
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


def test_an_earlier_run_is_replaced_and_what_lies_beside_it_stays(solution: Solution, tmp_path: Path) -> None:
    out = tmp_path / "run"
    write_run(solution, out)
    (out / "notes.txt").write_text("mine")
    (out / "poses.csv").write_text("stale")
    write_run(dataclasses.replace(solution, warnings=("second",)), out)
    assert read_run(out).warnings == ("second",)
    assert rows(out / "poses.csv")[0]["frame"] == "0"
    assert (out / "notes.txt").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_run_behind_a_link_is_replaced_where_it_lies(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "run")
    write_run(solution, tmp_path / "link")
    write_run(solution, tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert_same(read_run(tmp_path / "run"), solution)


def test_an_empty_folder_is_used(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    write_run(solution, tmp_path / "run")
    assert_same(read_run(tmp_path / "run"), solution)


def test_a_folder_of_other_things_is_left_alone(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "holiday.jpg").write_bytes(b"x")
    for attempt in (lambda: check_writable(tmp_path), lambda: write_run(solution, tmp_path)):
        with pytest.raises(RunFolderError, match=r"holds other files and no solution\.json"):
            attempt()
    assert [path.name for path in tmp_path.iterdir()] == ["holiday.jpg"]


def test_a_file_in_the_way_is_told(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(RunFolderError, match="is a file; expected a folder"):
        check_writable(tmp_path / "file")
    with pytest.raises(RunFolderError, match="file is a file"):
        check_writable(tmp_path / "file/deeper/run")
    with pytest.raises(RunFolderError, match="mount point"):
        check_writable(Path("/"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_place_without_permission_is_told(tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(RunFolderError, match="cannot be written"):
        check_writable(tmp_path / "locked/run")


def test_checking_changes_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "a/b/run")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_while_writing_leaves_the_earlier_run(
    solution: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_run(solution, tmp_path / "run")
    before = bytes_of(tmp_path / "run")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run_folder, "write_measurements", full)
    with pytest.raises(RunFolderError, match="No space left on device"):
        write_run(solution, tmp_path / "run")
    assert bytes_of(tmp_path / "run") == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


_KILLED = """
import os, pickle, sys
from pathlib import Path
from vgps.writers import run_folder
run_folder.write_measurements = lambda *_: os.kill(os.getpid(), 9)
run_folder.write_run(pickle.loads(sys.stdin.buffer.read()), Path(sys.argv[1]))
"""


def test_a_killed_run_leaves_no_file_under_a_final_name(solution: Solution, tmp_path: Path) -> None:
    import pickle

    out = tmp_path / "run"
    done = subprocess.run(
        [sys.executable, "-c", _KILLED, str(out)], input=pickle.dumps(solution), check=False, timeout=60
    )
    assert done.returncode == -9
    assert not out.exists()
    assert all(path.name.startswith(".run.new-") for path in tmp_path.iterdir())
    write_run(solution, out)
    assert_same(read_run(out), solution)


@pytest.mark.parametrize("name", ["solution.json", "measurements.npz", "config.yaml"])
def test_a_missing_piece_is_named(solution: Solution, tmp_path: Path, name: str) -> None:
    write_run(solution, tmp_path / "run")
    (tmp_path / "run" / name).unlink()
    with pytest.raises(RunFolderError, match=f"{name}: is missing"):
        read_run(tmp_path / "run")


def test_no_folder_at_all_is_told(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="not a folder"):
        read_run(tmp_path / "absent")


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(name=st.sampled_from(["solution.json", "measurements.npz"]), data=st.data())
def test_a_damaged_piece_is_an_error_or_harmless(
    solution: Solution, tmp_path: Path, name: str, data: st.DataObject
) -> None:
    write_run(solution, tmp_path / "run")
    file = tmp_path / "run" / name
    content = bytearray(file.read_bytes())
    where = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        content = content[:where]
    else:
        content[where] = data.draw(st.integers(0, 255))
    file.write_bytes(content)
    try:
        read_run(tmp_path / "run")
    except RunFolderError as error:
        assert str(tmp_path / "run") in str(error)
        assert "\n" not in str(error)


def test_pieces_that_do_not_fit_are_told(solution: Solution, tmp_path: Path) -> None:
    seen = solution.observations
    far = dataclasses.replace(seen, landmark=np.array([0, 2, 0, 3]))
    write_run(dataclasses.replace(solution, t_s=solution.t_s), tmp_path / "run")
    damaged = {
        "key observations.landmark: points at row 3 of 3": {"observations.landmark": far.landmark},
        "key world_T_camera: shape": {"world_T_camera": solution.world_T_camera[:2]},
        "'t_s' is missing": {"t_s": None},
    }
    with np.load(tmp_path / "run/measurements.npz") as archive:
        arrays = {key: archive[key] for key in archive.files}
    for message, change in damaged.items():
        changed = {key: value for key, value in {**arrays, **change}.items() if value is not None}
        np.savez(tmp_path / "run/measurements.npz", **changed)
        with pytest.raises(RunFolderError, match=message):
            read_run(tmp_path / "run")


def test_the_fix_table_must_be_as_long_as_the_log(solution: Solution, tmp_path: Path) -> None:
    assert solution.fixes is not None
    fixes = FixTable(
        **{name: getattr(solution.fixes, name)[:1] for name in solution.fixes.__dataclass_fields__}
    )
    write_run(solution, tmp_path / "run")
    with np.load(tmp_path / "run/measurements.npz") as archive:
        arrays = {key: archive[key] for key in archive.files}
    arrays["fixes.residual_m"] = fixes.residual_m
    np.savez(tmp_path / "run/measurements.npz", **arrays)
    with pytest.raises(RunFolderError, match=r"fixes\.residual_m"):
        read_run(tmp_path / "run")
