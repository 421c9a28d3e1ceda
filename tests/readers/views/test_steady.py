"""Pictures of a camera that zooms, scaled to one focal length."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from vgps.model import Camera, ControlPoints, FocalChanges, Frame, Recording, Rig
from vgps.readers.video.derived_video import DerivedVideo
from vgps.readers.views.steady import SteadyMasks, SteadyVideo, as_posed, steady

CAMERA = Camera(model="pinhole", width=160, height=120, fx=150.0, fy=150.0, cx=82.0, cy=57.0)
CHANGES = FocalChanges((0.0, 1.0), (0.0, 0.2), (82.0, 57.0))


def at_ratio(ratio: float) -> np.ndarray:
    """(120, 160) smooth grey values of a wall, seen with so many times the focal length."""
    v, u = np.mgrid[:120, :160].astype(float)
    x, y = (u - CAMERA.cx) / ratio, (v - CAMERA.cy) / ratio
    return np.round(127.5 + 60 * np.sin(x / 9) + 60 * np.cos(y / 11)).astype(np.uint8)


@dataclass(frozen=True)
class Zoom:
    """A video of two frames, the last of which has a larger focal length."""

    path = Path("zoom.mp4")
    times_s = np.array([0.0, 1.0])
    width, height = 160, 120

    def frames(self) -> Iterator[Frame]:
        for index, t_s in enumerate(self.times_s.tolist()):
            yield Frame(index, t_s, at_ratio(float(CHANGES.ratio(t_s))))

    def pictures(self, wanted: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        for frame in self.frames():
            if frame.index in wanted:
                yield frame.index, np.repeat(frame.gray[..., None], 3, axis=2)


def recording(masks: object = None, points: ControlPoints | None = None) -> Recording:
    rig = Rig(camera_p_antenna=np.zeros(3))
    return Recording(
        path=Path("zoom"), video=Zoom(), camera=CAMERA, rig=rig, masks=masks, control_points=points
    )


def test_pictures_are_as_if_the_focal_length_stayed():
    first, last = steady(recording(), CHANGES).video.frames()
    np.testing.assert_array_equal(first.gray, at_ratio(1.0))
    inside = SteadyMasks(SteadyVideo(Zoom(), CHANGES), None).of_frame(1)
    assert inside is not None
    assert np.abs(last.gray.astype(int) - at_ratio(1.0))[inside].max() <= 3
    ((index, picture),) = steady(recording(), CHANGES).video.pictures([1])
    assert index == 1
    np.testing.assert_array_equal(picture[..., 1], last.gray)


def test_what_lies_beyond_the_picture_does_not_show_the_scene():
    masks = steady(recording(), CHANGES).masks
    assert masks.of_frame(0) is None  # nothing is left out
    seen, shrink = masks.of_frame(1), np.exp(-0.2)
    assert seen[57, 82] and not seen[57, int(82 * (1 - shrink)) - 1] and seen[57, int(82 * (1 - shrink)) + 2]
    assert seen.mean() == pytest.approx(shrink**2, abs=0.02)


def test_masks_are_scaled_with_their_pictures():
    class Left:
        files = (Path("masks/0.png"),)

        def of_frame(self, _: int) -> np.ndarray:
            return np.arange(160) >= 42 + np.zeros((120, 1))

    masks = steady(recording(Left()), CHANGES).masks
    assert masks.files == Left.files
    np.testing.assert_array_equal(masks.of_frame(0), Left().of_frame(0))
    assert np.flatnonzero(masks.of_frame(1)[57])[0] == pytest.approx(82 - 40 * np.exp(-0.2), abs=1.0)


def test_control_points_are_where_scaled_pictures_show_them():
    points = ControlPoints(
        name=("A", "A", "B"),
        frame=np.array([0, 1, 7]),  # the last in a frame that is not there
        uv_px=np.array([[100.0, 60.0], [82.0 + 20.0, 57.0 - 10.0], [3.0, 4.0]]),
        world_p_point=np.zeros((3, 3)),
        sigma_m=np.zeros((3, 3)),
        check=np.zeros(3, bool),
        geodetic=False,
        source=Path("control_points.csv"),
        notes=(),
    )
    found = steady(recording(points=points), CHANGES).control_points
    shrink = np.exp(-0.2)
    expected = [[100.0, 60.0], [82.0 + 20.0 * shrink, 57.0 - 10.0 * shrink], [3.0, 4.0]]
    np.testing.assert_allclose(found.uv_px, expected)


def test_what_is_left_of_changes_is_scaled_away_from_the_pictures_themselves():
    """Not from the scaled ones, which would blur."""
    part, rest = (replace(CHANGES, log_ratio=(0.0, x)) for x in (0.15, 0.05))
    twice, once = steady(steady(recording(), part), rest), steady(recording(), CHANGES)
    for one, other in zip(twice.video.frames(), once.video.frames(), strict=True):
        np.testing.assert_array_equal(one.gray, other.gray)
        np.testing.assert_array_equal(twice.masks.of_frame(one.index), once.masks.of_frame(one.index))
    assert not isinstance(twice.video.video, DerivedVideo)
    np.testing.assert_allclose(twice.camera.focal_changes.log_ratio, CHANGES.log_ratio)


def test_changes_with_other_knots_add_up():
    both = FocalChanges((0.0, 2.0), (0.0, 0.2), (1.0, 2.0)).followed_by(
        FocalChanges((1.0, 3.0), (0.1, 0.3), (1.0, 2.0))
    )
    np.testing.assert_allclose(both.t_s, (0.0, 1.0, 2.0, 3.0))
    np.testing.assert_allclose(both.log_ratio, (0.1, 0.2, 0.4, 0.5))


def test_those_who_show_a_run_see_its_pictures():
    raw = recording()
    assert as_posed(raw, CAMERA) is raw
    posed = replace(CAMERA, focal_changes=CHANGES)
    shown = as_posed(raw, posed)
    assert isinstance(shown.video, SteadyVideo) and as_posed(shown, posed) is shown


def test_no_corner_arises_beyond_the_edge():
    rng = np.random.default_rng(0)
    gray = cv2.GaussianBlur(rng.integers(0, 255, (120, 160)).astype(np.uint8), (0, 0), 2)
    ((_, picture),) = SteadyVideo(_Still(gray), CHANGES).pictures([0])
    outside = ~SteadyMasks(SteadyVideo(_Still(gray), CHANGES), None).of_frame(0)
    strength = cv2.cornerMinEigenVal(picture, 7)
    deep = cv2.erode(outside.astype(np.uint8), np.ones((9, 9))) > 0
    assert strength[deep].max() < 0.05 * np.percentile(strength[~outside], 90)


@dataclass(frozen=True)
class _Still:
    """One picture, taken with the largest focal length."""

    gray: np.ndarray
    path = Path("still.png")
    times_s = np.array([1.0])
    width, height = 160, 120

    def pictures(self, _: list[int]) -> Iterator[tuple[int, np.ndarray]]:
        yield 0, self.gray
