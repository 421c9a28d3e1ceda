import numpy as np
import pytest
from inertial import MOUNT, exact_log, path_of, swinging_motion
from scipy.spatial.transform import Rotation

from vgps.config import Config, OnlineConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.dead_reckoning import DeadReckoning
from vgps.mapping.map_update import Similarity
from vgps.online.fusion.inertial_bridge import InertialBridge
from vgps.online.fusion.video_path import VideoPath

END_S, T_S = 6.0, 7.5
CONFIG = Config()
COVARIANCE = np.diag([0.01, 0.02, 0.03, 0.02, 1e-3, 1e-3, 1e-3]) ** 2


def path_and_map():
    """The path in a map of half the size that is turned and moved, and where the map lies in the world."""
    path = path_of(swinging_motion(), END_S)
    to_world = Similarity(
        2.0, Rotation.from_euler("z", 70.0, degrees=True).as_matrix(), np.array([5.0, -3.0, 1.0])
    )
    poses = path.world_T_camera.copy()
    poses[:, :3, :3] = to_world.world_R_map.T @ poses[:, :3, :3]
    poses[:, :3, 3] = 0.5 * (poses[:, :3, 3] - to_world.world_p_map) @ to_world.world_R_map
    return VideoPath(t_s=path.t_s, poses=poses, moving=np.ones(len(poses), dtype=bool)), to_world


def bridge(config=CONFIG):
    return InertialBridge(imu_at_camera(exact_log(swinging_motion()), MOUNT, None, config.imu), config)


def bridged(config=CONFIG, covariance=COVARIANCE):
    return bridge(config).pose(*path_and_map(), covariance, T_S)


def test_a_map_is_left_along_the_true_path_in_the_world():
    found, true = bridged(), swinging_motion().poses(np.array([T_S]))[0]
    np.testing.assert_allclose(found.world_T_camera[:3, 3], true[:3, 3], atol=0.1)
    np.testing.assert_allclose(found.world_T_camera[:3, :3], true[:3, :3], atol=0.005)
    assert (found.sigmas.position_m > np.sqrt(np.diag(COVARIANCE))[:3]).all()


def test_a_wrong_heading_counts_by_the_distance_since_features_were_seen():
    turned = COVARIANCE.copy()
    turned[6, 6] = np.radians(2.0) ** 2
    away_m = np.linalg.norm(np.diff(swinging_motion().poses(np.array([END_S, T_S]))[:, :2, 3], axis=0))
    by_heading = bridged(covariance=turned).sigmas.position_m ** 2 - bridged().sigmas.position_m ** 2
    assert np.sqrt(by_heading.sum()) == pytest.approx(np.radians(2.0) * away_m, rel=0.05)


def test_a_pose_that_is_too_uncertain_is_none():
    assert bridged(Config(online=OnlineConfig(bridge_sigma_m=0.05))) is None


@pytest.mark.filterwarnings("error")
def test_features_of_a_single_frame_show_no_velocity():
    path, to_world = path_and_map()
    assert bridge().pose(path.since(END_S), to_world, COVARIANCE, T_S) is None


def test_a_long_gap_costs_no_time(monkeypatch):
    integrated = []
    monkeypatch.setattr(DeadReckoning, "pose", lambda *given: integrated.append(given[-1]))
    for t_s in (T_S, END_S + 60.0, END_S + 3600.0):
        assert bridge().pose(*path_and_map(), COVARIANCE, t_s) is None
    assert integrated == [T_S]
