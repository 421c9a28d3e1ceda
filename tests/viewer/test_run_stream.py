"""Timelines and batches of a rerun recording."""

from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from reading_back import Logged

from vgps.viewer import run_stream
from vgps.viewer.run_stream import RunStream


def saved(file: Path, t_s: np.ndarray) -> RunStream:
    recording = rr.RecordingStream("test")
    recording.save(file)
    return RunStream(recording, t_s)


def read(stream: RunStream, file: Path) -> Logged:
    stream.recording.flush()
    stream.recording.disconnect()
    return Logged(file)


def test_times_between_frames_belong_to_the_frame_before(tmp_path: Path) -> None:
    stream = saved(tmp_path / "a.rrd", np.array([0.0, 0.1, 0.2]))
    t_s = np.array([-1.0, 0.05, 0.1, 0.19, 9.0])
    stream.send_times("dots", t_s, rr.Scalars.columns(scalars=t_s))
    found = read(stream, tmp_path / "a.rrd")
    assert found.times_s("/dots") == pytest.approx(t_s.tolist())
    assert found.frames("/dots") == [0, 0, 1, 1, 2]


def test_nan_is_left_out_of_a_series(tmp_path: Path) -> None:
    stream = saved(tmp_path / "b.rrd", np.array([0.0, 0.1, 0.2]))
    stream.send_series("line", np.array([1.0, np.nan, 3.0]))
    stream.send_series("nothing", np.full(3, np.nan))
    stream.send_series("dots", np.array([np.nan, 5.0]), np.array([0.02, 0.15]))
    found = read(stream, tmp_path / "b.rrd")
    assert found.rows("/line", "Scalars:scalars") == [[1.0], [3.0]]
    assert found.frames("/line") == [0, 2]
    assert found.times_s("/dots") == pytest.approx([0.15])
    assert "/nothing" not in found.entities


def test_batches_keep_the_instances_of_each_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_stream, "_CHUNK_FRAMES", 2)
    stream = saved(tmp_path / "c.rrd", np.arange(5) / 10)
    points = np.arange(12.0).reshape(6, 2)
    stream.send_batches(
        "points", np.array([1, 0, 3, 0, 2]), lambda rows: rr.Points2D.columns(positions=points[rows])
    )
    found = read(stream, tmp_path / "c.rrd").rows("/points", "Points2D:positions")
    assert found == [[[0, 1]], [], [[2, 3], [4, 5], [6, 7]], [], [[8, 9], [10, 11]]]
