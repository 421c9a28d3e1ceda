from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.solution import Solution
from vgps.writers.run_folder import write_run


def test_poses_tum_keeps_every_frame_to_the_nanometre(solution: Solution, tmp_path: Path) -> None:
    write_run(solution, tmp_path / "run")
    table = np.loadtxt(tmp_path / "run/poses.tum")
    np.testing.assert_allclose(table[:, 0], solution.t_s, atol=1e-9)
    np.testing.assert_allclose(table[:, 1:4], solution.world_T_camera[:, :3, 3], atol=1e-9)
    rotation = Rotation.from_quat(table[:, 4:]).as_matrix()
    np.testing.assert_allclose(rotation, solution.world_T_camera[:, :3, :3], atol=1e-11)
    assert (table[:, 7] >= 0).all()
    np.testing.assert_allclose(table[0, 4:], [-0.5, 0.5, -0.5, 0.5], atol=1e-12)  # axes east, down, south
