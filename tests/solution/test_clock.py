"""Time stamps of a receiver whose clock differs from the video's, by hand."""

import numpy as np
import pytest

from vgps.solution import GpsClock


def test_positions_are_older_by_the_offset_and_more_in_each_second():
    clock = GpsClock(0.5, 0.01)
    np.testing.assert_allclose(clock.on_video(np.array([0.0, 100.0])), [-0.5, 98.5])


def test_a_video_of_29_97_frames_a_second_taken_for_30():
    true_s = 3000 / (30.0 / 1.001)  # when frame 3000 was taken, which such a video has at 100 s
    assert GpsClock(0.0, 1.0 - 1.0 / 1.001).on_video(true_s) == pytest.approx(100.0, abs=1e-9)


def test_time_stamps_are_those_of_the_times():
    clock, t_s = GpsClock(-0.3, 0.02), np.array([0.0, 12.5, 80.0])
    np.testing.assert_allclose(clock.on_video(clock.time_stamps(t_s)), t_s, atol=1e-12)
