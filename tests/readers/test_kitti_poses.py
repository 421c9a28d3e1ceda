from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.errors import TrajectoryError
from vgps.readers.kitti_poses import read_kitti_poses


def test_what_was_written_is_read(tmp_path: Path) -> None:
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("y", 20.0 * np.arange(5)[:, None], degrees=True).as_matrix()
    poses[:, :3, 3] = np.arange(15).reshape(5, 3)
    np.savetxt(tmp_path / "poses.txt", poses[:, :3].reshape(-1, 12), "%.6e")
    np.testing.assert_allclose(read_kitti_poses(tmp_path / "poses.txt"), poses, atol=1e-5)


def test_kittis_own_file(data_dir: Path) -> None:
    poses = read_kitti_poses(data_dir / "paths/kitti_05.txt")
    assert poses.shape == (2761, 4, 4)
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-6)


@pytest.mark.parametrize(
    "line",
    [
        "1 0 0 0 0 1 0 0 0 0 1",
        "1 0 0 0 0 1 0 0 0 0 1 x",
        "1 0 0 0 0 1 0 0 0 0 1 nan",
        "2 0 0 0 0 1 0 0 0 0 1 0",
        "1 0 0 0 0 1 0 0 0 0 -1 0",
    ],
    ids=["short", "text", "nan", "scaled", "mirrored"],
)
def test_a_line_that_is_no_pose_is_named(tmp_path: Path, line: str) -> None:
    (tmp_path / "poses.txt").write_text(f"1 0 0 0 0 1 0 0 0 0 1 0\n\n{line}\n")
    with pytest.raises(TrajectoryError, match=r"line 3: .*expected the first three rows"):
        read_kitti_poses(tmp_path / "poses.txt")
