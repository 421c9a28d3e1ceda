import numpy as np
import pytest
from exports import exported


def test_kitti_is_what_evo_reads(solution, tmp_path):
    file_interface = pytest.importorskip("evo.tools.file_interface", reason="evo is the oracle")
    read = file_interface.read_kitti_poses_file(exported(solution, tmp_path, "kitti", "poses.txt"))
    np.testing.assert_allclose(np.array(read.poses_se3), solution.world_T_camera, atol=1e-9)
