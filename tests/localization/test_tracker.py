import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from textured_wall import CAMERA, picture, pose_at

from vgps.config import LocalizationConfig
from vgps.localization.frame_estimator import FrameEstimator
from vgps.localization.landmark_predictor import LandmarkPredictor
from vgps.localization.pose import NO_MATCHES, PoseEstimate
from vgps.localization.prediction import RotationPredictor
from vgps.localization.tracker import LandmarkTracker

BLACK = np.full((240, 320), 16, np.float32)
ROTATIONS = RotationPredictor(None, None)


class KnownPoses:
    """Recovery that proposes given poses and counts the calls."""

    def __init__(self, *poses):
        self.poses, self.calls = list(poses), 0

    def candidates(self, image, at_middle_row):
        self.calls += 1
        return self.poses


def tracker(database, recovery, estimator=None, **changes):
    config = LocalizationConfig(max_landmarks=60, first_landmarks=30, **changes)

    def views(pose, count):
        return database.views(pose, CAMERA, max_landmarks=count)

    predictor = LandmarkPredictor(CAMERA, views, ROTATIONS, 0.0, config)
    estimator = estimator or FrameEstimator(config.max_velocity_gap_s)
    return LandmarkTracker(CAMERA.K, predictor, ROTATIONS, estimator, recovery, config)


def off_m(frame, pose):
    return np.linalg.norm(frame.world_T_camera[:3, 3] - pose[:3, 3])


def test_it_starts_by_recovery_and_then_follows(database):
    recovery = KnownPoses(pose_at(5.0), pose_at(0.0))  # the first is false
    tracked = tracker(database, recovery)
    frames = [tracked.add(t, picture(pose_at(t))) for t in (0.0, 0.05, 0.1)]
    assert [frame.recovered for frame in frames] == [True, False, False]
    assert recovery.calls == 1
    for frame in frames:
        assert off_m(frame, pose_at(frame.t_s)) < 0.05
        assert np.isfinite(frame.covariance).all()
        assert frame.correlation > 0.8


def test_without_any_pose_a_frame_is_nan(database):
    frame = tracker(database, KnownPoses()).add(0.0, picture(pose_at(0.0)))
    assert not frame.tracked and not frame.recovered
    assert np.isnan(frame.world_T_camera).all() and np.isnan(frame.covariance).all()
    assert len(frame.observations) == 0


def test_a_lost_frame_has_the_predicted_pose(database):
    tracked = tracker(database, KnownPoses(pose_at(0.0)))
    for t in (0.0, 0.05):
        tracked.add(t, picture(pose_at(t)))
    lost = tracked.add(0.1, BLACK)
    assert not lost.tracked
    assert off_m(lost, pose_at(0.1)) < 0.1


def test_recovery_pauses_after_a_failure(database):
    recovery = KnownPoses(pose_at(0.0))
    tracked = tracker(database, recovery, recovery_pause_s=0.25)
    for k in range(6):  # attempts at 0.0 and 0.3 s
        tracked.add(0.1 * k, BLACK)
    assert recovery.calls == 2


@pytest.mark.slow
def test_after_coasting_for_too_long_a_prediction_is_not_searched(database):
    for coast_s, recovered in ((0.35, True), (0.45, False)):
        tracked = tracker(database, KnownPoses(pose_at(0.0)), coast_s=coast_s, recovery_pause_s=0.0)
        still = picture(pose_at(0.0))
        tracked.add(0.0, still)
        for t in (0.1, 0.2, 0.3):
            assert not tracked.add(t, BLACK).tracked
        assert tracked.add(0.4, still).recovered is recovered


@pytest.mark.parametrize(("limit_deg", "followed"), [(0.3, False), (6.0, True)])
def test_a_pose_that_is_rotated_too_far_from_the_prediction_is_refused(database, limit_deg, followed):
    start = pose_at(0.0)
    rotated = start.copy()
    rotated[:3, :3] = rotated[:3, :3] @ Rotation.from_euler("y", 2, degrees=True).as_matrix()
    recovery = KnownPoses(start)
    tracked = tracker(database, recovery, max_rotation_error_deg=limit_deg)
    tracked.add(0.0, picture(start))
    recovery.poses = []
    assert tracked.add(0.1, picture(rotated)).tracked is followed


def at_east(x):
    """A camera in front of the wall."""
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


@pytest.mark.parametrize("speed_m_s", [10.0, 25.0, 40.0, 60.0])
def test_a_fast_camera_is_followed_from_its_start(database, speed_m_s):
    estimator = FrameEstimator(0.5)
    recovery = KnownPoses(at_east(-4.0))
    tracked = tracker(database, recovery, estimator)
    for k in range(5):  # at 60 m/s it moves 2 m or 60 px between frames
        pose = at_east(-4.0 + speed_m_s * k / 30)
        frame = tracked.add(k / 30, picture(pose))
        recovery.poses = []
        assert frame.tracked and frame.recovered == (k == 0)
        assert off_m(frame, pose) < 0.05
        if k > 0:
            np.testing.assert_allclose(estimator.motion.world_v_camera, [speed_m_s, 0, 0], atol=1.5)


def test_a_false_velocity_is_refuted_by_the_next_frame(database):
    estimator = FrameEstimator(0.5)
    for t_s, x in ((0.0, -5.0), (0.1, 0.0)):  # the first pose is false: 50 m/s
        estimator.add(t_s, PoseEstimate(at_east(x), np.eye(6), np.zeros(0, bool)), NO_MATCHES, restart=True)
    frame = tracker(database, KnownPoses(), estimator).add(0.2, picture(at_east(0.1)))
    assert frame.tracked and not frame.recovered
    assert off_m(frame, at_east(0.1)) < 0.05
