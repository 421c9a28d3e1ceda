"""Videos changed as those of users are."""

import numpy as np
import pytest

import vgps
from scripts.experiments.changed_videos import (
    ChangedVideo,
    Stretches,
    as_it_is,
    black,
    cases,
    converted,
    dark,
    exposed,
    missing,
    stamped,
    without,
)

T_S = 0.1 * np.arange(20)


@pytest.mark.parametrize(
    ("factor", "shown"), [(2.0, [0, 0, 1, 1, 2, 2]), (1.5, [0, 0, 1, 2, 2, 3]), (2.5, [0, 0, 0, 1, 1, 2])]
)
def test_more_frames_a_second_repeat_the_newest_picture(factor, shown):
    pictures, at_s = converted(T_S, factor)
    assert pictures[:6].tolist() == shown
    np.testing.assert_allclose(np.diff(at_s), 0.1 / factor)
    assert (T_S[pictures] <= at_s + 1e-6).all() and (at_s - T_S[pictures] < 0.1).all()


def test_frames_that_are_missing_leave_the_others_their_times():
    kept, at_s = missing(T_S, 0.3)
    assert 0 < len(kept) < len(T_S) and (at_s == T_S[kept]).all()


def test_frames_that_a_computer_stamped_are_late_by_turns():
    shown, at_s = stamped(T_S, 0.05)
    assert shown.tolist() == list(range(20))
    assert (at_s >= T_S).all() and 0.03 < (at_s - T_S).max() < 0.05


def test_frames_are_those_of_the_times_and_pictures(recording):
    video = vgps.open_recording(recording).video
    shown, at_s = converted(video.times_s[:4], 2.0)
    made = list(ChangedVideo(video, shown, at_s, as_it_is).frames())
    pictures = [frame.gray for frame, _ in zip(video.frames(), range(4), strict=False)]
    assert [frame.index for frame in made] == list(range(len(at_s)))
    assert all((frame.gray == pictures[k]).all() for frame, k in zip(made, shown, strict=True))
    np.testing.assert_allclose([frame.t_s for frame in made], at_s)


def test_an_exposure_jumps_in_turns():
    gray = np.full((2, 2), 200, np.uint8)
    assert [int(exposed(4.0)(gray, t_s)[0, 0]) for t_s in (0.0, 0.7, 0.8, 1.4, 1.6)] == [
        200,
        200,
        50,
        50,
        200,
    ]


def test_the_lens_is_hidden_at_the_end_of_each_period():
    hidden, gray = Stretches(0.5, 2.0), np.full((2, 2), 200, np.uint8)
    times = (0.0, 1.4, 1.5, 1.9, 2.0, 3.5)
    assert [int(black(hidden)(gray, t_s)[0, 0]) for t_s in times] == [200, 200, 0, 0, 200, 0]
    kept, at_s = without(T_S, hidden)
    assert kept.tolist() == list(range(15)) and (at_s == T_S[:15]).all()


def test_a_dark_picture_has_less_light_and_noise():
    made = dark(10.0, 4.0)(np.full((100, 100), 200, np.uint8), 0.3)
    assert 19.5 < made.mean() < 20.5 and 3.5 < made.std() < 4.5


def test_the_first_frames_to_show_a_picture_count(recording):
    opened = vgps.open_recording(recording)
    true = np.tile(np.eye(4), (len(opened.video.times_s), 1, 1))
    true[:, 0, 3] = np.arange(len(true))
    for case in cases(opened, true):
        video = case.recording.video
        assert len(video.shown) == len(video.times_s)
        assert case.true[:, 0, 3].tolist() == sorted(set(video.shown.tolist()))
        assert (video.shown[case.frame] == case.true[:, 0, 3]).all()
        late = video.times_s[case.frame] - opened.video.times_s[video.shown[case.frame]]
        assert late.max() < opened.video.times_s[1]  # no other frame shows it earlier
