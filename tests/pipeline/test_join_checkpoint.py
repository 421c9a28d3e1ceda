"""Places that were found are taken over by the same join alone."""

import numpy as np
import pytest

from vgps.config import Config
from vgps.errors import RunFolderError
from vgps.pipeline.join_checkpoint import JoinCheckpoint
from vgps.places.loops import Loop


@pytest.fixture
def runs(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "measurements.npz").write_bytes(name.encode())
    return [tmp_path / "a", tmp_path / "b"]


def loop():
    return Loop(
        frame=7,
        earlier=3,
        world_T_camera=np.eye(4),
        landmark=np.array([5, 9]),
        raw_uv_px=np.array([[1.0, 2.0], [3.0, 4.0]]),
    )


def never():
    raise AssertionError("searched again")


def test_places_are_searched_once(tmp_path, runs):
    assert JoinCheckpoint(tmp_path / "out", runs, None, resume=True).loops(lambda: (loop(),))[0].frame == 7
    again = JoinCheckpoint(tmp_path / "out", runs, None, resume=True)
    (found,) = again.loops(never)
    assert (found.frame, found.earlier) == (7, 3) and found.landmark.tolist() == [5, 9]
    np.testing.assert_array_equal(found.raw_uv_px, loop().raw_uv_px)
    assert JoinCheckpoint(tmp_path / "out", runs, None, resume=False).loops(tuple) == ()
    again.remove()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_places_of_other_runs_or_settings_are_refused(tmp_path, runs):
    JoinCheckpoint(tmp_path / "out", runs, None, resume=False).loops(tuple)
    for others, config in ((runs[::-1], None), (runs, Config(seed=3))):
        with pytest.raises(RunFolderError, match="other runs, settings or another version"):
            JoinCheckpoint(tmp_path / "out", others, config, resume=True).loops(never)
    (runs[1] / "measurements.npz").write_bytes(b"another run")
    with pytest.raises(RunFolderError, match="without --resume"):
        JoinCheckpoint(tmp_path / "out", runs, None, resume=True).loops(never)
