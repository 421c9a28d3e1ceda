"""Run folders read back: older and later ones, damaged ones, and pieces that do not fit."""

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from distinct_solution import distinct_values
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from run_files import assert_same
from solutions import PINHOLE

from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run
from vgps.solution import FixTable, Solution
from vgps.writers.run_folder import write_run


@pytest.fixture
def solution() -> Solution:
    return distinct_values()


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


def test_a_run_without_schema_versions_loads(solution: Solution, tmp_path: Path) -> None:
    """As written before version 0.1.0."""
    run = tmp_path / "run"
    write_run(solution, run)
    summary = json.loads((run / "solution.json").read_text("utf-8"))
    del summary["schema_version"], summary["schema_versions"]
    (run / "solution.json").write_text(json.dumps(summary), "utf-8")
    with np.load(run / "measurements.npz") as archive:
        arrays = {key: archive[key] for key in archive.files if key != "schema_version"}
    np.savez(run / "measurements.npz", **arrays)
    assert_same(read_run(run), solution)


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


@pytest.mark.parametrize("name", ["solution.json", "measurements.npz", "config.yaml"])
def test_a_missing_file_of_a_run_is_named(solution: Solution, tmp_path: Path, name: str) -> None:
    write_run(solution, tmp_path / "run")
    (tmp_path / "run" / name).unlink()
    with pytest.raises(RunFolderError, match=f"{name}: is missing"):
        read_run(tmp_path / "run")


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="not a folder"):
        read_run(tmp_path / "absent")


@pytest.mark.slow
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(name=st.sampled_from(["solution.json", "measurements.npz"]), data=st.data())
def test_a_damaged_file_is_an_error_or_harmless(
    solution: Solution, tmp_path: Path, name: str, data: st.DataObject
) -> None:
    if not (tmp_path / "run").exists():
        write_run(solution, tmp_path / "run")
    file = tmp_path / "run" / name
    whole = file.read_bytes()
    content = bytearray(whole)
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
    finally:
        file.write_bytes(whole)


@pytest.mark.slow
def test_arrays_that_do_not_fit_are_refused(solution: Solution, tmp_path: Path) -> None:
    seen = solution.observations
    far = dataclasses.replace(seen, landmark=np.array([0, 2, 0, 3]))
    write_run(dataclasses.replace(solution, t_s=solution.t_s), tmp_path / "run")
    damaged = {
        "key observations.landmark: points at row 3 of 3": {"observations.landmark": far.landmark},
        "key world_T_camera: shape": {"world_T_camera": solution.world_T_camera[:2]},
        "key graph.frame_rates: shape": {"graph.frame_rates": np.zeros((2, 3))},
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


def rewritten(file: Path, change, compression=zipfile.ZIP_STORED) -> None:
    """Rewrite an archive with members changed."""
    with zipfile.ZipFile(file) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in change(members).items():
            archive.writestr(name, content)


@pytest.mark.slow
def test_an_archive_that_unpacks_to_far_more_is_not_unpacked(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    file = tmp_path / "run/measurements.npz"
    rewritten(file, lambda members: {**members, "t_s.npy": b"\0" * 50_000_000}, zipfile.ZIP_DEFLATED)
    with pytest.raises(RunFolderError, match=r"t_s\.npy unpacks to 50000000 bytes"):
        read_run(tmp_path / "run")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"'shape': (4,)", b"'shape': (99999999999999,)", "fewer values than its shape"),
        (b"'descr': '<f8'", b"'descr': '<i8'", "key t_s: values of type int64; expected floats"),
        (b"'shape': (4,)", b"'shape': (4,", "is damaged"),
    ],
)
def test_an_array_of_another_type_or_size_is_refused(
    solution: Solution, tmp_path: Path, old: bytes, new: bytes, message: str
) -> None:
    write_run(solution, tmp_path / "run")

    def change(members):
        head = members["t_s.npy"].replace(old, new)
        pad = len(head) - len(members["t_s.npy"])
        at = head.index(b"\n", 20) - pad
        return {**members, "t_s.npy": head[:at] + head[at + pad :] if pad > 0 else head}

    rewritten(tmp_path / "run/measurements.npz", change)
    with pytest.raises(RunFolderError, match=message):
        read_run(tmp_path / "run")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("world_origin", {"latitude_deg": "north"}, r"key world_origin\.latitude_deg"),
        ("world_origin", {"latitude_deg": 91, "longitude_deg": 0, "height_m": 0}, "less than or equal to 90"),
        ("seconds", [], "key seconds"),
        ("camera", {}, r"key camera\.model: is missing"),
        ("camera", {**vars(PINHOLE), "readout_s": "fast"}, r"key camera\.readout_s"),
        ("camera", {**vars(PINHOLE), "readout_axis": "diagonal"}, r"key camera\.readout_axis"),
        ("cameras", 2, "key cameras"),
        ("cameras", [{"name": "rear"}], r"key cameras\.0\.camera"),
        ("cameras", [{"name": "rear", "camera": vars(PINHOLE)}], r"cameras\.0\.reference_T_camera"),
    ],
)
def test_a_summary_of_another_kind_is_refused(
    solution: Solution, tmp_path: Path, key: str, value, message: str
) -> None:
    write_run(solution, tmp_path / "run")
    file = tmp_path / "run/solution.json"
    file.write_text(json.dumps({**json.loads(file.read_text("utf-8")), key: value}), "utf-8")
    with pytest.raises(RunFolderError, match=message):
        read_run(tmp_path / "run")
