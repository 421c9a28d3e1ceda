"""Exports of a run folder, read back with other programs' readers where there are any."""

from pathlib import Path

import numpy as np
import pytest

from vgps.errors import RunFolderError
from vgps.solution import Solution
from vgps.writers.export import FORMATS, export
from vgps.writers.run_folder import write_run

PLY_ROW = np.dtype(
    [("xyz", "<f8", 3), ("rgb", "u1", 3), ("sigma_px", "<f8"), ("observations", "<i4")]
)  # 24 + 3 + 8 + 4 bytes


@pytest.fixture
def run(solution: Solution, tmp_path: Path) -> Path:
    write_run(solution, tmp_path / "run")
    return tmp_path / "run"


def test_tum_is_the_file_of_the_run_folder(run: Path, tmp_path: Path) -> None:
    export(run, "tum", tmp_path / "deeper/out.tum")
    assert (tmp_path / "deeper/out.tum").read_bytes() == (run / "poses.tum").read_bytes()
    assert [path.name for path in (tmp_path / "deeper").iterdir()] == ["out.tum"]


def test_ply_has_its_header_and_rows_byte_by_byte(run: Path, tmp_path: Path, solution: Solution) -> None:
    export(run, "ply", tmp_path / "out.ply")
    header, _, body = (tmp_path / "out.ply").read_bytes().partition(b"end_header\n")
    lines = header.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert "comment origin latitude 49.011 longitude 8.4165 ellipsoidal height 163.0" in lines
    assert lines[-9:] == [
        "element vertex 3",
        "property double x",
        "property double y",
        "property double z",
        "property uchar red",
        "property uchar green",
        "property uchar blue",
        "property double sigma_px",
        "property int observations",
    ]
    rows = np.frombuffer(body, dtype=PLY_ROW)
    np.testing.assert_array_equal(rows["xyz"], solution.landmarks.world_p_landmark)
    np.testing.assert_array_equal(rows["rgb"], [[7] * 3, [128] * 3, [255] * 3])
    np.testing.assert_array_equal(rows["sigma_px"], [0.5, 0.25, 1.5])
    np.testing.assert_array_equal(rows["observations"], [2, 0, 2])


def test_ply_is_what_plyfile_reads(run: Path, solution: Solution) -> None:
    plyfile = pytest.importorskip("plyfile", reason="plyfile is the oracle for PLY")
    vertices = plyfile.PlyData.read(run / "points.ply")["vertex"]
    found = np.column_stack([vertices[axis] for axis in "xyz"])
    np.testing.assert_array_equal(found, solution.landmarks.world_p_landmark)
    assert vertices["green"].tolist() == [7, 128, 255]
    assert vertices["observations"].tolist() == [2, 0, 2]


def test_an_unknown_format_names_those_there_are(run: Path, tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match=r"unknown format 'tumm'; expected one of .*ply, tum"):
        export(run, "tumm", tmp_path / "out")


def test_what_is_no_run_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="not a folder"):
        export(tmp_path / "absent", "ply", tmp_path / "out.ply")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("to", sorted(set(FORMATS) - {"colmap"}))
def test_a_failure_keeps_the_file_that_was_there(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, to: str
) -> None:
    out = tmp_path / "out"
    out.write_text("earlier")

    def half(_: Solution, path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(FORMATS, to, half)
    with pytest.raises(RunFolderError, match="out: cannot be written"):
        export(run, to, out)
    assert out.read_text() == "earlier"
    assert {path.name for path in tmp_path.iterdir()} == {"run", "out"}


def test_a_folder_in_the_way_is_told(run: Path, tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="is a folder; expected the name of a file"):
        export(run, "ply", tmp_path)


def test_a_colmap_model_replaces_an_earlier_one_and_nothing_else(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "model"
    export(run, "colmap", out)
    (out / "cameras.txt").write_text("an older one")
    (out / "notes.txt").write_text("mine")
    export(run, "colmap", out)
    assert (out / "cameras.txt").read_text() != "an older one"
    assert (out / "notes.txt").read_text() == "mine"
    (out / "origin.json").unlink()
    with pytest.raises(RunFolderError, match=r"holds other files and no origin\.json"):
        export(run, "colmap", out)
