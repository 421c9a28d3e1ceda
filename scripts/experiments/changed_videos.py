"""What do jumping exposures, repeated, missing or late pictures, noise, blur, darkness and zoom do to poses?

The videos of recordings with truth are changed as those of users are. Errors are unaligned, offline and live
as poses came, of the frames that are the first to show their picture: where the camera was when it was taken.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from scripts.common.both_ways import Case, print_both_ways
from vgps.model import BoolArray, Camera, FloatArray, Frame, GrayImage, IntArray, Recording
from vgps.readers.video.derived_video import DerivedVideo

JUMPS_S = 1.5  # the exposure jumps twice in this time
Change = Callable[[GrayImage, float], GrayImage]
Order = tuple[IntArray, FloatArray]


@dataclass(frozen=True)
class ChangedVideo(DerivedVideo):
    """A video that shows pictures of another one at other times, changed.

    Attributes:
        shown: (F,) the pictures, ascending; some may repeat.
        at_s: (F,) times of the frames.
        change: Function of a picture and the time of its frame.
    """

    shown: IntArray
    at_s: FloatArray
    change: Change

    @property
    def times_s(self) -> FloatArray:
        """(F,) times of the frames."""
        return self.at_s

    def frames(self) -> Iterator[Frame]:
        """Yield the frames."""
        index = 0
        for frame in self.video.frames():
            while index < len(self.shown) and self.shown[index] == frame.index:
                t_s = float(self.at_s[index])
                yield replace(frame, index=index, t_s=t_s, gray=self.change(frame.gray, t_s))
                index += 1


@dataclass(frozen=True)
class Stretches:
    """Stretches of a video, the last ``length_s`` of every ``period_s`` from the time 0 on."""

    length_s: float
    period_s: float

    def contain(self, t_s: FloatArray | float) -> BoolArray:
        """Return whether each time is in one."""
        return np.asarray(np.mod(t_s, self.period_s) > self.period_s - self.length_s - 1e-6)


def as_it_is(gray: GrayImage, _: float) -> GrayImage:
    """Return the picture."""
    return gray


def exposed(factor: float) -> Change:
    """Return what darkens every other stretch of a video by a factor."""
    return lambda gray, t_s: gray if t_s % JUMPS_S < JUMPS_S / 2 else (gray / factor).astype(np.uint8)


def noisy(sigma: float) -> Change:
    """Return what adds noise of so many gray values, the same for the same time."""

    def change(gray: GrayImage, t_s: float) -> GrayImage:
        noise = np.random.default_rng(round(1e3 * t_s)).normal(0.0, sigma, gray.shape)
        return np.clip(gray + noise, 0, 255).astype(np.uint8)

    return change


def blurred(sigma_px: float) -> Change:
    """Return what takes a picture out of focus."""
    return lambda gray, _: np.asarray(cv2.GaussianBlur(gray, (0, 0), sigma_px), np.uint8)


def dark(factor: float, sigma: float) -> Change:
    """Return what a camera sees in so many times less light, with noise of so many gray values."""
    return lambda gray, t_s: noisy(sigma)((gray / factor).astype(np.uint8), t_s)


def black(hidden: Stretches) -> Change:
    """Return what hides the lens in stretches of a video."""
    return lambda gray, t_s: np.zeros_like(gray) if hidden.contain(t_s) else gray


def breathing(camera: Camera, share: float, period_s: float) -> Change:
    """Return what changes the focal length to and fro by a share of it, as a lens does that focuses."""
    return _scaled(camera, lambda t_s: share * np.sin(2.0 * np.pi * t_s / period_s))


def zoomed(camera: Camera, factor: float, first_s: float, last_s: float) -> Change:
    """Return what zooms by a factor between two times."""
    return _scaled(camera, lambda t_s: np.log(factor) * np.clip((t_s - first_s) / (last_s - first_s), 0, 1))


def _scaled(camera: Camera, log_ratio: Callable[[float], float]) -> Change:
    def change(gray: GrayImage, t_s: float) -> GrayImage:
        ratio, (height, width) = float(np.exp(log_ratio(t_s))), gray.shape
        shift = (1.0 - ratio) * np.array([camera.cx, camera.cy])
        M = np.column_stack([ratio * np.eye(2), shift])
        return np.asarray(cv2.warpAffine(gray, M, (width, height), borderMode=cv2.BORDER_REFLECT), np.uint8)

    return change


def converted(t_s: FloatArray, factor: float) -> Order:
    """Return pictures and times of a video with more frames a second: each shows the newest picture."""
    at_s = np.arange(t_s[0], t_s[-1], float(np.median(np.diff(t_s))) / factor)
    return np.searchsorted(t_s, at_s + 1e-6, side="right") - 1, at_s


def nearest(t_s: FloatArray, factor: float) -> Order:
    """Return the same if each picture is first shown by the frame nearest to it."""
    at_s = converted(t_s, factor)[1]
    first = np.round((t_s - t_s[0]) / (at_s[1] - at_s[0]))
    return np.searchsorted(first, np.arange(len(at_s)), side="right") - 1, at_s


def closest(t_s: FloatArray, factor: float) -> Order:
    """Return the same if each frame shows the closest picture, even one to come."""
    at_s = converted(t_s, factor)[1]
    return np.abs(at_s[:, None] - t_s).argmin(axis=1), at_s


def missing(t_s: FloatArray, share: float) -> Order:
    """Return pictures and times of a video that lost a share of its frames."""
    kept = np.flatnonzero(np.random.default_rng(0).random(len(t_s)) >= share)
    return kept, t_s[kept]


def stamped(t_s: FloatArray, most_s: float) -> Order:
    """Return pictures and times of a video whose frames a computer stamped late, by turns."""
    return np.arange(len(t_s)), t_s + np.random.default_rng(0).uniform(0.0, most_s, len(t_s))


def without(t_s: FloatArray, lost: Stretches) -> Order:
    """Return pictures and times of a video that lost stretches of frames."""
    kept = np.flatnonzero(~lost.contain(t_s))
    return kept, t_s[kept]


def shown_at(recording: Recording, order: Order, change: Change = as_it_is) -> Recording:
    """Return a recording with pictures at other times, changed."""
    return replace(recording, video=ChangedVideo(recording.video, *order, change))


def cases(recording: Recording, true: FloatArray) -> Iterator[Case]:
    """Yield a recording with each changed video; the first frames to show a picture count.

    Args:
        recording: The recording.
        true: (F, 4, 4) its true poses.
    """
    t_s, camera = recording.video.times_s, recording.camera
    order = np.arange(len(t_s)), t_s
    for name, (shown, at_s), change in (
        ("as it is", order, as_it_is),
        ("exposure jumps by 1.5", order, exposed(1.5)),
        ("exposure jumps by 2", order, exposed(2.0)),
        ("exposure jumps by 4", order, exposed(4.0)),
        ("every picture twice", converted(t_s, 2.0), as_it_is),
        ("1.5 times the frames", converted(t_s, 1.5), as_it_is),
        ("2.5 times the frames", converted(t_s, 2.5), as_it_is),
        ("1.25 times, from the nearest frame on", nearest(t_s, 1.25), as_it_is),
        ("1.25 times, the closest picture", closest(t_s, 1.25), as_it_is),
        ("three of ten frames missing", missing(t_s, 0.3), as_it_is),
        ("time stamps late by up to 0.05 s", stamped(t_s, 0.05), as_it_is),
        ("noise of 15 gray values", order, noisy(15.0)),
        ("blur of 3 px", order, blurred(3.0)),
        ("a tenth of the light, noise of 4 gray values", order, dark(10.0, 4.0)),
        ("black for 2 s of 5", order, black(Stretches(2.0, 5.0))),
        ("frames missing for 0.5 s of 2", without(t_s, Stretches(0.5, 2.0)), as_it_is),
        ("frames missing for 1 s of 3", without(t_s, Stretches(1.0, 3.0)), as_it_is),
        ("focus that breathes by 0.5 %", order, breathing(camera, 0.005, 7.0)),
        ("focus that breathes by 1 %", order, breathing(camera, 0.01, 7.0)),
        ("focus that breathes by 2 %", order, breathing(camera, 0.02, 7.0)),
        ("zoom of 1.1 in 2 s", order, zoomed(camera, 1.1, 6.0, 8.0)),
        ("zoom of 1.3 in 2 s", order, zoomed(camera, 1.3, 6.0, 8.0)),
        ("zoom of 2 in 2 s", order, zoomed(camera, 2.0, 6.0, 8.0)),
    ):
        picture, first = np.unique(shown, return_index=True)
        yield Case(name, shown_at(recording, (shown, at_s), change), first, true[picture])


def main() -> None:
    """Print a markdown table, two rows per recording, change and seed."""
    print_both_ways("experiments.changed_videos", __doc__, "video", "gps_float.nmea", cases)


if __name__ == "__main__":
    main()
