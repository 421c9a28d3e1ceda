import numpy as np
import pytest

from vgps.errors import TrajectoryError
from vgps.readers.trajectory import read_trajectory


def test_poses_with_normalised_quaternions(tmp_path):
    path = tmp_path / "truth.tum"
    path.write_text("# t x y z q\n10 1 2 3 0 0 0 1\n\n10.5,4,5,6,0,0,2,2 # a quarter turn about z\n")
    read = read_trajectory(path, video_start_s=10.0)
    assert read.t_s.tolist() == [0, 0.5]
    np.testing.assert_allclose(
        read.world_T_camera[0], [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    )
    expected = [[0, -1, 0, 4], [1, 0, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]]
    np.testing.assert_allclose(read.world_T_camera[1], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("# only this\n", "no poses"),
        ("0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0\n", "line 2: '1 1 2 3 0 0 0'; expected t_s x y z qx qy qz qw"),
        ("0 1 2 3 0 0 0 x\n", "line 1"),
        ("0 1 2 nan 0 0 0 1\n", "line 1"),
        ("0 1 2 3 0 0 0 0\n", "line 1"),
        ("0 1 2 3 0 0 0 1e308\n", "line 1"),
        ("1 1 2 3 0 0 0 1\n# x\n1 1 2 3 0 0 0 1\n", "line 3: time 1; expected one later"),
    ],
)
def test_a_line_that_is_not_a_pose_is_refused(tmp_path, text, message):
    path = tmp_path / "truth.tum"
    path.write_text(text)
    with pytest.raises(TrajectoryError, match=message):
        read_trajectory(path)


def test_the_truth_of_kitti03_is_a_level_drive_of_561_m(data_dir):
    truth = read_trajectory(data_dir / "kitti03/truth.tum")
    assert truth.world_T_camera.shape == (801, 4, 4)
    assert np.linalg.norm(np.diff(truth.world_T_camera[:, :3, 3], axis=0), axis=1).sum() == pytest.approx(
        561, abs=1
    )
    assert (truth.world_T_camera[:, :3, 1] @ [0, 0, -1] > 0.9).all()  # the camera's y axis points down
