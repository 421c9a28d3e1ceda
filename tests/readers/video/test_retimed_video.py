import numpy as np
from room_pipeline import POSES
from textured_room import RoomVideo

from vgps.readers.video.retimed_video import RetimedVideo


def test_frames_have_the_times_that_are_given():
    video, at_s = RoomVideo(POSES[:3]), np.array([0.0, 0.07, 0.21])
    retimed = RetimedVideo(video, at_s)
    assert [(one.index, one.t_s, one.repeats) for one in retimed.frames()] == [
        (0, 0.0, False),
        (1, 0.07, False),
        (2, 0.21, False),
    ]
    np.testing.assert_array_equal(retimed.times_s, at_s)
    assert (retimed.path, retimed.width, retimed.warnings) == (video.path, video.width, ())
    for shown, frame in zip(retimed.frames(), video.frames(), strict=True):
        np.testing.assert_array_equal(shown.gray, frame.gray)


def test_frames_say_which_of_them_are_known_to_repeat_a_picture():
    retimed = RetimedVideo(RoomVideo(POSES[:3]), np.arange(3.0), np.array([False, True, False]))
    assert [one.repeats for one in retimed.frames()] == [False, True, False]
    again = RetimedVideo(retimed, np.arange(3.0) + 1.0)  # what is known stays known
    assert [(one.t_s, one.repeats) for one in again.frames()] == [(1.0, False), (2.0, True), (3.0, False)]
