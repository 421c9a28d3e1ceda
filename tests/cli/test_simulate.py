"""``vgps simulate`` along a given path, as a user runs it."""

from pathlib import Path

import numpy as np
import pytest

from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory


@pytest.mark.slow
def test_a_recording_along_kittis_path(vgps_verb, data_dir: Path, tmp_path: Path) -> None:
    poses, out = data_dir / "paths/kitti_05.txt", tmp_path / "out"
    code, _, err = vgps_verb(
        *("simulate", "--path", poses, "--first-pose", 60, "--poses", 10, "--fps", 5, "--out", out)
    )
    assert code == 0, err
    recording, truth = open_recording(out), read_trajectory(out / "truth.tum")
    assert len(recording.video.times_s) == len(truth) == 5
    rows = np.loadtxt(poses)[60:70:2].reshape(-1, 3, 4)
    np.testing.assert_allclose(
        np.diff(truth.world_T_camera[:, :2, 3], axis=0),
        np.diff(np.stack([rows[:, 2, 3], -rows[:, 0, 3]], axis=-1), axis=0),
        atol=1e-6,
    )


def test_a_part_without_poses_is_refused(vgps_verb, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 20)
    code, _, err = vgps_verb(
        *("simulate", "--path", tmp_path / "poses.txt", "--first-pose", 15, "--out", tmp_path / "out")
    )
    assert code == 2 and err.count("\n") == 1 and "5 poses from pose 15 on, of 20" in err
    assert not (tmp_path / "out").exists()


def test_a_pass_has_a_seed_of_its_own(vgps_verb, monkeypatch, tmp_path: Path) -> None:
    asked = []
    monkeypatch.setattr("vgps.simulate.simulate", lambda out, config, seed: asked.append((config, seed)))
    for own in ([], ["--pass-seed", 7]):
        assert vgps_verb("simulate", "--out", tmp_path / "out", "--seed", 3, *own)[0] == 0
    assert [(config.pass_seed, seed) for config, seed in asked] == [(None, 3), (7, 3)]
