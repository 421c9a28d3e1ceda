import errno

import numpy as np
import pytest
from run_files import assert_same

from vgps.errors import RunFolderError
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.runtime.state_file import read_state, write_state


def test_a_state_is_read_as_it_was_written(tmp_path):
    shared = TimeOffset(0.1, float("nan"))
    state = {
        "arrays": [np.arange(6).reshape(2, 3), np.zeros((0, 4), np.float32), np.array([True])],
        "plain": {1: (None, True, -0.0, 2**100, "ü"), (2, 3): {4, 5}},
        "scalar": np.float64(0.1),
        "first": Sensors(0.5, np.ones(3), shared, np.zeros(3)),
        "second": shared,
    }
    write_state(state, tmp_path / "s.npz", [Sensors, TimeOffset])
    found = read_state(tmp_path / "s.npz", [Sensors, TimeOffset])
    for key in ("plain", "scalar", "first", "second"):
        assert_same(found[key], state[key])
    for one, other in zip(found["arrays"], state["arrays"], strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.dtype == other.dtype and one.flags.writeable
    assert found["first"].prior_time_offset is found["second"]


def test_what_nobody_named_is_neither_written_nor_made(tmp_path):
    with pytest.raises(TypeError, match="TimeOffset cannot be stored"):
        write_state({"a": TimeOffset(0.0, 0.0)}, tmp_path / "s.npz", [])
    assert list(tmp_path.iterdir()) == []
    write_state({"a": TimeOffset(0.0, 0.0)}, tmp_path / "s.npz", [TimeOffset])
    with pytest.raises(RunFolderError, match=r"is damaged .*; run again without --resume"):
        read_state(tmp_path / "s.npz", [])


def test_a_damaged_state_is_one_line(tmp_path):
    write_state({"a": np.arange(100)}, tmp_path / "s.npz", [])
    whole = (tmp_path / "s.npz").read_bytes()
    (tmp_path / "s.npz").write_bytes(whole[:200])
    with pytest.raises(RunFolderError, match="is damaged"):
        read_state(tmp_path / "s.npz", [])


def test_attributes_of_others_are_left_out(tmp_path):
    write_state({"a": TimeOffset(0.1, 0.2)}, tmp_path / "s.npz", [TimeOffset], without=("sigma_s",))
    assert vars(read_state(tmp_path / "s.npz", [TimeOffset])["a"]) == {"time_offset_s": 0.1}


def test_a_full_disk_leaves_the_last_state(tmp_path, monkeypatch):
    write_state({"a": 1}, tmp_path / "s.npz", [])

    def full(stream, **arrays):
        stream.write(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(OSError, match="No space left"):
        write_state({"a": 2}, tmp_path / "s.npz", [])
    assert [file.name for file in tmp_path.iterdir()] == ["s.npz"]
    assert read_state(tmp_path / "s.npz", []) == {"a": 1}
