"""A map under construction, with results of stage A made by hand."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.config import ImuConfig, TrackingConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.rotation import RotationPredictor
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFeatures, NewView
from vgps.mapping.retention import RetentionPolicy
from vgps.model import Frame, ImuLog, ImuMount
from vgps.pipeline.map_builder import MapBuilder
from vgps.tracking.pose import Prediction
from vgps.tracking.tracking_result import TrackingResult

UNKNOWN = np.full((4, 4), np.nan)
FEATURES = np.array([[10.0, 10.0], [50.0, 20.0], [90.0, 80.0]])
CONFIG = TrackingConfig(static_px=0.4)


def pose(x, angle=0.0):
    out = np.eye(4)
    out[:3, :3], out[0, 3] = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix(), x
    return out


def image(gray=0):
    return np.full((4, 6), gray, dtype=np.uint8)


def builder(*poses, first=0, interval_s=0.1):
    """A map of frames with these poses; its newest view is the last frame and shows three features."""
    local_map, nothing = LocalMap(first, 5), np.zeros((0, 2))
    made = MapBuilder(local_map=local_map, view_image=image())
    for k, each in enumerate(poses):
        made.add_pose(interval_s * (first + k), each)
    view = NewView(first + len(poses) - 1, nothing, nothing, np.zeros(0, dtype=bool))
    features = NewFeatures(FEATURES, FEATURES, np.zeros(3, dtype=np.uint8))
    local_map.apply(MapUpdate(view=view, features=features))
    return made


def result(moved_px=(0.0, 0.0, 0.0), found=(True, True, True), **pose_of):
    uv = FEATURES + np.outer(moved_px, [0.6, 0.8])
    return TrackingResult(raw_uv_px=uv, uv_px=uv, found=np.array(found), **pose_of)


def test_the_velocity_of_the_last_two_frames_goes_on():
    """Half a metre ahead and 0.1 rad a frame: the displacement turns with the camera."""
    made = builder(pose(0.0), pose(0.5, 0.1))
    predicted = made.predict(0.2).world_T_camera
    expected = pose(0.5, 0.2)
    expected[:2, 3] = 0.5 + 0.5 * np.cos(0.1), 0.5 * np.sin(0.1)
    np.testing.assert_allclose(predicted, expected, atol=1e-12)


@pytest.mark.parametrize(("now_s", "x"), [(0.24, 1.0), (0.26, 0.5), (3.0, 0.5)])
def test_after_a_gap_the_last_pose_is_the_prediction(now_s, x):
    assert builder(pose(0.0), pose(0.5)).predict(now_s).world_T_camera[0, 3] == pytest.approx(x)


def test_predictions_stay_rotations_where_every_other_frame_is_interpolated():
    """Errors of rounding would double with each: pictures that repeat are posed, left out and bridged."""
    made = builder(pose(0.0), pose(0.5, 0.1), interval_s=0.05)
    for t_s in 0.1 + 0.1 * np.arange(40):
        made.add_pose(t_s, made.predict(t_s).world_T_camera)
        predicted = made.predict(t_s + 0.05).world_T_camera
        made.local_map.apply(MapUpdate(end=made.local_map.next_frame - 1))
        made.bridge(np.array([t_s]), t_s + 0.05, predicted)
        made.add_pose(t_s + 0.05, predicted)
    R = made.local_map.poses[-1, :3, :3]
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)


def test_without_a_pose_before_the_last_one_it_is_the_prediction():
    np.testing.assert_array_equal(builder(UNKNOWN, pose(0.5)).predict(0.2).world_T_camera, pose(0.5))


def steady_gyro(bias_rad_s):
    """A gyro that does not turn, with a bias about the viewing axis."""
    t_s = np.arange(-0.5, 10.0, 0.01)
    rate = np.tile([0.0, 0.0, bias_rad_s], (len(t_s), 1))
    force = np.tile([0.0, -9.8, 0.0], (len(t_s), 1))
    log = ImuLog(
        t_s=t_s, rate_rad_s=rate, force_m_s2=force, saturated=np.zeros(len(t_s), bool), source=Path()
    )
    return RotationPredictor(
        imu_at_camera(log, ImuMount(imu_R_camera=np.eye(3), imu_p_camera=np.zeros(3)), None, ImuConfig()),
        ImuConfig(),
    )


def test_a_new_map_knows_the_gyro_s_bias_from_the_one_before():
    earlier = builder(*[pose(0.1 * k) for k in range(20)])
    new = builder(pose(0.0), pose(0.1), first=20)
    alone = new.predict(2.2, steady_gyro(0.04))
    assert Rotation.from_matrix(alone.world_T_camera[:3, :3]).magnitude() == pytest.approx(0.004, rel=0.01)
    known = new.predict(2.2, steady_gyro(0.04), [earlier.local_map, new.local_map])
    np.testing.assert_allclose(known.world_T_camera, pose(0.2), atol=1e-9)
    assert known.rotation_sigma_rad < 0.2 * alone.rotation_sigma_rad


def carried(made, frame, found=(True, True, True), sigma_rad=1e-3, share=0.3):
    """The result of a lost frame at ten frames a second, with a gyro by default."""
    config = CONFIG.model_copy(update={"min_inliers": 2, "min_inlier_share": share})
    prediction = Prediction(pose(0.1 * frame), sigma_rad)
    return made.carried(Frame(frame, 0.1 * frame, image()), result(found=found), prediction, config)


def test_a_gyro_carries_a_map_on_where_features_without_positions_are_followed():
    made = builder(pose(0.0), pose(0.1))
    np.testing.assert_array_equal(carried(made, 2).world_T_camera, pose(0.2))
    lost = (
        carried(builder(pose(0.0), pose(0.1)), 3),
        carried(builder(pose(0.0), pose(0.1)), 2, found=(True, False, False)),
        carried(builder(pose(0.0), pose(0.1)), 2, found=(True, True, False), share=0.7),
        carried(builder(pose(0.0), pose(0.1)), 2, sigma_rad=np.inf),
    )
    assert all(each.world_T_camera is None for each in lost)


def test_a_gyro_carries_a_map_on_for_half_a_second_after_features_posed_a_frame():
    made = builder(pose(0.0), pose(0.1))
    for frame in range(2, 6):
        made.add_pose(0.1 * frame, carried(made, frame).world_T_camera)
    posed = result(world_T_camera=pose(0.6))
    assert made.carried(Frame(6, 0.6, image()), posed, Prediction(pose(0.6)), CONFIG) is posed
    made.add_pose(0.6, pose(0.6))
    for frame in range(7, 12):
        made.add_pose(0.1 * frame, carried(made, frame).world_T_camera)
    assert carried(made, 12).world_T_camera is None


def stands(moved_px, found=(True, True, True), frame=3, retention=None):
    made = builder(pose(0.0), pose(0.5))
    return not made.extend(Frame(frame, 0.1 * frame, image()), result(moved_px, found), CONFIG, retention)


def test_a_frame_stands_if_its_median_feature_does():
    assert stands((0.1, 0.39, 9.0)) and not stands((0.1, 0.41, 9.0))
    assert stands((0.1, 0.2, 9.0), (True, True, False))
    assert not stands((0.1, 9.0, 9.0), (False, True, True))


def test_a_frame_that_shows_no_feature_does_not_stand():
    assert not stands((0.0, 0.0, 0.0), (False, False, False))


def shown_again(last_px, moved_px=(0.0, 0.0, 0.0)):
    """A map of a camera at half a metre and 5 px a frame, whose picture stays for three frames."""
    made = builder(pose(0.0), pose(0.5))
    made.speed_px_s = 50.0
    for index, px, x in (
        (2, moved_px, 0.5),
        (3, moved_px, 0.5),
        (4, moved_px, 0.5),
        (5, (last_px,) * 3, 2.5),
    ):
        frame = Frame(index, 0.1 * index, image())
        seen = result(px, world_T_camera=pose(x), pose_sigma=np.ones(6))
        if made.shows_repeats(frame, seen, CONFIG):
            made.bridge(made.discard_repeats(), frame.t_s, seen.world_T_camera)
        made.extend(frame, seen, CONFIG, None)
    return made.local_map


def test_a_picture_that_stays_while_the_camera_moves_on_is_left_out():
    local_map = shown_again(20.0)
    assert local_map.bridged == {2, 3, 4} and not local_map.zero_motions
    np.testing.assert_allclose(local_map.poses[:, 0, 3], 0.5 * np.arange(6), atol=1e-12)
    np.testing.assert_allclose(local_map.odometry[1:, 0], 0.5, atol=1e-12)


def test_a_camera_that_goes_on_from_where_it_was_stood():
    assert [motion.frame for motion in shown_again(5.0).zero_motions] == [2, 3, 4]


def one_stays(speed_px_s, last_px, repeats=False):
    """A map whose picture stays for a single frame, or is known to repeat, between two steps."""
    made = builder(pose(0.0), pose(0.5))
    made.speed_px_s = speed_px_s
    still = result((0.0,) * 3, world_T_camera=pose(0.5), pose_sigma=np.ones(6))
    made.extend(Frame(2, 0.2, image(), repeats=repeats), still, CONFIG, None)
    after = result((last_px,) * 3, world_T_camera=pose(1.0), pose_sigma=np.ones(6))
    return made.shows_repeats(Frame(3, 0.3, image()), after, CONFIG)


def test_nothing_stands_for_a_single_frame_between_two_that_move():
    """As in videos that were converted from 20 to 30 frames a second: each step is as large as before."""
    assert one_stays(20.0, 2.0) and one_stays(15.0, 1.2)
    assert not one_stays(8.0, 1.2)  # it had nearly stopped
    assert not one_stays(15.0, 0.7)  # it hardly moves again
    assert not one_stays(40.0, 1.9)


def test_what_is_known_to_repeat_does_however_slowly_the_camera_moves():
    assert not one_stays(3.0, 0.5) and one_stays(3.0, 0.5, repeats=True)
    made = builder(pose(0.0), pose(0.5))
    still = result((0.0,) * 3, world_T_camera=pose(0.5), pose_sigma=np.ones(6))
    made.extend(Frame(2, 0.2, image(), repeats=True), still, CONFIG, None)
    assert not made.shows_repeats(Frame(3, 0.3, image(), repeats=True), still, CONFIG)


def test_a_camera_that_creeps_is_where_its_features_say():
    local_map = shown_again(20.0, (0.1, 0.1, 0.1))
    assert not local_map.bridged and len(local_map.zero_motions) == 3


def test_a_long_stop_gets_a_view_before_the_last_one_is_discarded():
    policy = RetentionPolicy(view_frames=10, path_s=2.0)
    still = (0.0, 0.0, 0.0)
    assert stands(still, frame=11, retention=policy) and not stands(still, frame=12, retention=policy)
    assert stands(still, frame=700)


def test_a_standing_frame_is_constrained_to_the_newest_view_by_its_pose():
    made = builder(pose(0.0), pose(2.0, np.pi / 2))
    sigma = np.array([1e-3, 1e-3, 0.0, 0.1, 0.1, 1e-9])
    made.add_zero_motion(2, result(world_T_camera=pose(2.5, np.pi / 2), pose_sigma=sigma))
    (motion,) = made.local_map.zero_motions
    assert (motion.frame, motion.reference) == (2, 1)
    # half a metre along the world's x is along the camera's -y
    np.testing.assert_allclose(motion.reference_T_frame[:3, 3], [0.0, -0.5, 0.0], atol=1e-12)
    assert motion.sigma.tolist() == [1e-3, 1e-3, 1e-6, 0.1, 0.1, 1e-6]


def test_before_the_map_has_poses_a_standing_frame_is_constrained_to_no_motion():
    made = builder(UNKNOWN, UNKNOWN)
    made.add_zero_motion(2, result())
    (motion,) = made.local_map.zero_motions
    np.testing.assert_array_equal(motion.reference_T_frame, np.eye(4))
    assert (motion.frame, motion.reference) == (2, 1) and motion.sigma.min() > 0


def test_frames_of_a_gap_are_posed_between_its_ends():
    made = builder(pose(0.0), pose(1.0), first=7)
    made.bridge(np.array([0.9, 1.0]), 1.2, pose(3.0, 0.4))
    assert made.local_map.next_frame == 11 and made.local_map.bridged == {9, 10}
    # frame 8 at 0.8 s, frame 11 at 1.2 s: a quarter and a half of the way
    expected = [pose(1.5, 0.1), pose(2.0, 0.2)]
    np.testing.assert_allclose(made.local_map.poses[2:], expected, atol=1e-12)
    np.testing.assert_allclose(made.local_map.t_s[2:], [0.9, 1.0])


def test_without_a_gap_nothing_is_bridged():
    made = builder(pose(0.0), pose(1.0))
    made.bridge(np.zeros(0), 0.2, pose(2.0))
    assert made.local_map.next_frame == 2 and not made.local_map.bridged


def test_a_view_takes_over_image_and_features_that_were_found():
    made = builder(pose(0.0))
    made.add_pose(0.1, pose(0.5))
    made.add_view(Frame(1, 0.1, image(9)), result((5.0, 5.0, 5.0), (True, False, True)))
    assert made.view_image[0, 0] == 9 and made.local_map.view_frames[-1] == 1
    assert made.local_map.ids.tolist() == [0, 2]
    np.testing.assert_array_equal(made.local_map.last_uv_px, FEATURES[[0, 2]] + (3.0, 4.0))
