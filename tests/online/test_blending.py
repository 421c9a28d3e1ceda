import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vgps.config import OnlineConfig
from vgps.online.blending import Blender

CONFIG = OnlineConfig(blend_s=2.0, blend_m_s=1.0, blend_deg_s=5.0)
metres = st.floats(-30.0, 30.0)


def pose(x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), (x, y, z)
    return out


def test_without_corrections_both_poses_are_equal():
    blender = Blender(CONFIG)
    np.testing.assert_array_equal(blender.advance(pose(3.0), 0.1), pose(3.0))


def test_a_correction_fades_by_hand():
    blender = Blender(CONFIG)
    blender.correct(pose(0.0), pose(0.5))
    # 0.5 m decay slower than 1 m/s: by exp(-0.1 / 2)
    assert blender.advance(pose(0.5), 0.1)[0, 3] == pytest.approx(0.5 - 0.5 * np.exp(-0.05))
    blender = Blender(CONFIG)
    blender.correct(pose(0.0), pose(20.0))
    # 20 m would decay by 0.98 m in a tenth of a second: limited to 0.1 m
    assert blender.advance(pose(20.0), 0.1)[0, 3] == pytest.approx(0.1)


@pytest.mark.slow
@settings(deadline=None, max_examples=15)
@given(metres, metres, st.floats(-3.0, 3.0))
def test_the_smooth_pose_never_jumps_and_arrives(x, y, turn):
    blender, before, now = Blender(CONFIG), pose(), pose(x, y, 0.0, (0.0, 0.0, turn))
    blender.correct(before, now)
    smooth = before
    for _ in range(600):
        following = blender.advance(now, 0.1)
        assert np.linalg.norm(following[:3, 3] - smooth[:3, 3]) <= 1.0 * 0.1 + 1e-9
        step = Rotation.from_matrix(following[:3, :3] @ smooth[:3, :3].T).magnitude()
        assert step <= np.radians(5.0) * 0.1 + 1e-9
        smooth = following
    np.testing.assert_allclose(smooth, now, atol=1e-3)


def test_a_second_correction_starts_from_where_the_smooth_pose_is():
    blender = Blender(CONFIG)
    blender.correct(pose(0.0), pose(2.0, turn=(0.0, 0.0, 0.2)))
    smooth = blender.advance(pose(2.0, turn=(0.0, 0.0, 0.2)), 0.5)
    corrected = pose(-1.0, turn=(0.1, 0.0, -0.2))
    blender.correct(pose(2.0, turn=(0.0, 0.0, 0.2)), corrected)
    np.testing.assert_allclose(blender.advance(corrected, 1e-9), smooth, atol=1e-7)
