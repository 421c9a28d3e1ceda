from pathlib import Path

import numpy as np
import pytest

from vgps.solution import Solution
from vgps.writers.export import export

PLY_ROW = np.dtype(
    [("xyz", "<f8", 3), ("rgb", "u1", 3), ("sigma_px", "<f8"), ("observations", "<i4")]
)  # 24 + 3 + 8 + 4 bytes


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
