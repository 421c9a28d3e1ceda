import numpy as np
from synthetic_run import PINHOLE, poses, render, texture

from vgps.config import LandmarksConfig
from vgps.geometry import project
from vgps.landmarks.descriptors import describe
from vgps.landmarks.keyframes import keyframe_rows, make_keyframe
from vgps.landmarks.observation_selection import LandmarkObservations

POSE = poses()[10]
IMAGE = render(PINHOLE, POSE, texture())


def test_the_first_usable_frame_of_every_ten() -> None:
    usable = np.ones(35, bool)
    usable[[0, 1, 20]] = False
    usable[30:] = False
    assert keyframe_rows(usable, 10).tolist() == [2, 10, 21]


def landmarks_beside_features(offset_px: float) -> np.ndarray:
    """Points of the wall (12 m north) whose projections lie that far to the right of features."""
    uv = describe(IMAGE, 40)[0] + (offset_px, 0)
    ray = np.column_stack([(uv - (PINHOLE.cx, PINHOLE.cy)) / (PINHOLE.fx, PINHOLE.fy), np.ones(len(uv))])
    world = ray @ POSE[:3, :3].T
    return POSE[:3, 3] + (12.0 - POSE[1, 3]) / world[:, 1:2] * world


def observed(points: np.ndarray, first_id: int = 0) -> LandmarkObservations:
    """The observations of points by the frame."""
    uv, depth = project(PINHOLE.K, POSE, points)
    n = len(points)
    return LandmarkObservations(
        landmark=np.arange(n) + first_id,
        frame=np.full(n, 10),
        world_T_camera=np.tile(POSE, (n, 1, 1)),
        world_p_landmark=points,
        uv_px=uv,
        depth_m=depth,
        error_px=np.zeros(n),
    )


def test_features_are_placed_at_the_depth_of_their_landmarks() -> None:
    points = landmarks_beside_features(1.0)
    keyframe = make_keyframe(IMAGE, PINHOLE, POSE, observed(points, 70), LandmarksConfig())
    assert len(keyframe.landmark) >= len(points) > 20
    assert (np.diff(keyframe.landmark) >= 0).all()
    uv, depth = project(PINHOLE.K, POSE, keyframe.world_p_landmark)
    uv_landmark, landmark_depth = project(PINHOLE.K, POSE, points[keyframe.landmark - 70])
    np.testing.assert_allclose(depth, landmark_depth)
    assert np.linalg.norm(uv - uv_landmark, axis=1).max() <= 4.0


def test_features_out_of_reach_are_left_out() -> None:
    points = landmarks_beside_features(1.0)
    config = LandmarksConfig(keyframe_reach_px=0.01)
    assert len(make_keyframe(IMAGE, PINHOLE, POSE, observed(points), config).landmark) == 0


def test_a_frame_without_landmarks_keeps_its_thumbnail() -> None:
    keyframe = make_keyframe(
        IMAGE, PINHOLE, POSE, observed(np.zeros((0, 3))), LandmarksConfig(thumbnail_px=80)
    )
    assert len(keyframe.landmark) == 0 and keyframe.descriptors.shape == (0, 32)
    assert keyframe.thumbnail.shape == (60, 80)
    assert abs(float(keyframe.thumbnail.mean()) - float(IMAGE.mean())) < 1
