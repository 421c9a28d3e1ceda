import numpy as np
import pytest
from textured_wall import WallVideo, recording_of

from vgps.config import LocalizationConfig
from vgps.localization import Localizer

pytestmark = pytest.mark.slow

BIAS = (0.02, -0.01, 0.015)
SMALL = {"max_landmarks": 60, "first_landmarks": 30}


def localized(recording, database, **changes):
    """The localizer after the video, and its frames."""
    localizer = Localizer(recording, database, LocalizationConfig(**changes, **SMALL))
    return localizer, [localizer.add(f.t_s, localizer.undistort(f.gray)) for f in recording.video.frames()]


def test_the_graph_estimates_the_gyros_bias(database):
    localizer, _ = localized(recording_of(WallVideo(25), BIAS), database)
    np.testing.assert_allclose(localizer.gyro_bias_rad_s, BIAS, atol=0.008)


def test_a_gyro_that_is_not_used_leaves_no_bias(database):
    localizer, frames = localized(recording_of(WallVideo(3), BIAS), database, use_gyro=False)
    assert not localizer.gyro_bias_rad_s.any()
    assert not localizer.rotations.covers(0.0, 0.1)
    assert all(frame.tracked for frame in frames)


def test_a_camera_lost_for_long_is_relocalized_by_descriptors(database):
    recording = recording_of(WallVideo(14, black=tuple(range(3, 10))))
    _, frames = localized(recording, database, coast_s=0.3)
    # a failed attempt is followed by a pause of a quarter of a second
    start, again = (i for i, frame in enumerate(frames) if frame.recovered)
    assert start == 0
    assert again in {10, 11, 12}
    assert all(frame.tracked for frame in frames[again:])
    assert not any(frame.tracked for frame in frames[3:10])


def test_only_the_graph_revises_poses(database):
    for estimator, revised in (("frame", 0), ("graph", 4)):
        localizer, _ = localized(recording_of(WallVideo(4)), database, estimator=estimator)
        assert len(localizer.revised()) == revised
