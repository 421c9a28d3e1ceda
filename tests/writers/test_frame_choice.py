from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageFilter
from solutions import EAST_R_CAMERA, make_poses, make_solution

from vgps.errors import RunFolderError
from vgps.readers.video.images import ImageFolder
from vgps.solution import FrameState, Observations
from vgps.writers.frame_choice import FrameChoice, choose_frames, subset


@pytest.fixture
def drive():
    """Ten frames a second, a metre a frame for a second, then standing."""
    t_s = np.arange(20) / 10
    places = np.minimum(np.arange(20.0), 10)[:, None] * [1.0, 0, 0]
    return make_solution(t_s, make_poses(places, EAST_R_CAMERA))


def chosen(solution, **choice):
    return choose_frames(solution, FrameChoice(**choice), None).tolist()


def test_a_frame_every_metres_or_seconds(drive):
    assert chosen(drive) == list(range(20))
    assert chosen(drive, every_m=4.0) == [0, 4, 8]
    assert chosen(drive, every_s=0.5) == [0, 5, 10, 15]


def test_a_tracked_frame_is_chosen_before_a_bridged_one(drive):
    """The picture of a bridged one may be black, or that of the frame before it."""
    state = [FrameState.BRIDGED if k in (0, 1, 5, *range(10, 15)) else FrameState.TRACKED for k in range(20)]
    assert chosen(replace(drive, state=tuple(state)), every_s=0.5) == [2, 6, 10, 15]


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"every_m": 0.0}, "a stretch of 0 between frames; expected more than 0"),
        ({"every_s": float("nan")}, "a stretch of nan"),
        ({"every_m": 1.0, "every_s": 1.0}, "together; give one of them"),
        ({"select": "sharp"}, "no frames to compare; name the recording with --images"),
    ],
)
def test_what_cannot_be_chosen_is_refused(drive, choice, message):
    with pytest.raises(RunFolderError, match=message):
        chosen(drive, **choice)


def test_the_sharpest_of_each_stretch(drive, tmp_path):
    rng = np.random.default_rng(0)
    sharp = Image.fromarray(rng.integers(0, 255, (60, 80), np.uint8))
    for frame in range(20):
        # frames 3, 7, 12 and 19 are sharp
        picture = sharp if frame in (3, 7, 12, 19) else sharp.filter(ImageFilter.GaussianBlur(1 + frame % 3))
        picture.save(tmp_path / f"{frame}.png")
    (tmp_path / "frame_times.csv").write_text("frame,t_s\n" + "".join(f"{k},{k / 10}\n" for k in range(20)))
    choice = FrameChoice(select="sharp", every_s=0.5)
    assert choose_frames(drive, choice, ImageFolder(tmp_path)).tolist() == [3, 7, 12, 19]


def test_a_subset_keeps_the_observations_in_its_frames(drive):
    seen = Observations(np.array([0, 4, 5, 8, 4]), np.array([0, 1, 2, 3, 4]), np.arange(10.0).reshape(5, 2))
    run = subset(replace(drive, observations=seen), np.array([0, 4, 8]))
    assert run.t_s.tolist() == [0, 0.4, 0.8]
    assert run.observations.frame.tolist() == [0, 1, 2, 1]
    assert run.observations.landmark.tolist() == [0, 1, 3, 4]
    assert run.observations.uv_px[3].tolist() == [8.0, 9.0] and len(run.state) == 3
