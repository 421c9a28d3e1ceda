"""``vgps join`` as a user runs it; the adjustment itself is in tests/pipeline/test_join.py."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from vgps.pipeline.join_folders import join_folders
from vgps.readers.trajectory import read_trajectory


def test_a_mistake_is_one_line(vgps_verb, tmp_path: Path) -> None:
    for words in (
        ["join", tmp_path / "a", "--out", tmp_path / "out"],
        ["join", "a", "b", "--out", tmp_path / "o"],
    ):
        code, out, err = vgps_verb(*words)
        assert (code, out) == (2, "") and err.startswith("vgps: ") and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_interrupted_join_goes_on_from_the_places_and_a_worker_gives_the_same(
    vgps_verb, smoothed_brief: Path, tmp_path: Path, monkeypatch
) -> None:
    """A run that is joined with itself keeps its poses."""
    pytest.importorskip("distributed")
    shutil.copytree(smoothed_brief, tmp_path / "again")
    runs = ["join", smoothed_brief, tmp_path / "again", "--out"]
    with threadpool_limits(limits=2, user_api="blas"):  # as for a user; a worker has one
        with monkeypatch.context() as patched:  # ends while it writes, after the places are found
            patched.setattr("vgps.pipeline.join_folders.write_joined", interrupted)
            with pytest.raises(KeyboardInterrupt):
                join_folders([smoothed_brief, tmp_path / "again"], tmp_path / "out")
        assert not (tmp_path / "out").exists() and (tmp_path / ".out.resume/places.npz").is_file()
        with monkeypatch.context() as patched:
            patched.setattr("vgps.pipeline.join.find_loops", interrupted)  # not searched again
            code, out, err = vgps_verb(*runs, tmp_path / "out", "--resume")
    assert code == 0, err
    assert f"frames of again see places of {smoothed_brief.name}" in out
    assert "frames of 2 runs in one world" in out
    assert vgps_verb(*runs, tmp_path / "whole", "--scheduler", "local")[0] == 0
    for name in ("again/poses.tum", "again/poses.csv", "points.ply"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert not list(tmp_path.glob(".*.resume"))
    before = read_trajectory(smoothed_brief / "poses.tum").world_T_camera
    for name in (smoothed_brief.name, "again"):
        after = read_trajectory(tmp_path / "out" / name / "poses.tum").world_T_camera
        np.testing.assert_allclose(after, before, atol=2e-3)  # metres, and radians


def interrupted(*_args, **_options):
    raise KeyboardInterrupt
