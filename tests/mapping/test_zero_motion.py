import numpy as np
from scipy.spatial.transform import Rotation

from vgps.mapping.zero_motion import ZeroMotion, scaled_pose


def test_a_smaller_unit_scales_displacement_and_its_sigma_and_leaves_the_rotation():
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix(), [1.0, -2.0, 0.5]
    motion = ZeroMotion(7, 4, pose, np.array([0.1, 0.2, 0.3, 1.0, 2.0, 3.0]))
    scaled = motion.scaled(4.0)
    assert (scaled.frame, scaled.reference) == (7, 4)
    np.testing.assert_array_equal(scaled.reference_T_frame[:3, :3], pose[:3, :3])
    np.testing.assert_array_equal(scaled.reference_T_frame[:3, 3], [4.0, -8.0, 2.0])
    assert scaled.sigma.tolist() == [0.1, 0.2, 0.3, 4.0, 8.0, 12.0]
    assert pose[0, 3] == 1.0 and scaled_pose(pose, 0.5)[1, 3] == -1.0
