"""Times of the pictures of a video whose time stamps are not those at which they were taken.

A camera takes pictures at even times. A converter to another frame rate gives each frame the nearest picture,
or the newest. Frames that are the first to show one then have times that are off by up to a frame, by turns,
and by a part of that in the mean: half a frame is 0.2 m at 10 m/s and 25 frames a second. Which frames repeat
a picture tells the even times. A computer that stamps pictures as they come is late by turns, too; the path
is smoother over the even times.
"""

from bisect import bisect
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linprog
from scipy.special import entr

from vgps.config import Config
from vgps.errors import GeometryError, GpsLogError
from vgps.geometry.even_times import CLEAR, even_times, smoother_by
from vgps.mapping.local_map import LocalMap
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.readers.video.retimed_video import RetimedVideo
from vgps.runtime.progress import Progress

_CHANCE = 1e-3  # that pictures of a recorder that hangs now and then lie so close to a line
_ROUNDED = 1e-3  # frames by which time stamps are rounded
_NOTABLE = 0.05  # frames by which times have to be off for another run
_CLOSE = 0.5  # frames between pictures where even times end
# Of an interval of pictures, by which all may be late. In the mean a picture is first shown at its time (from
# the frame nearest to it on), half a frame later (from the one after it), or half of what is between the two
# intervals earlier (as soon as it is nearer than the picture before).
_UNKNOWN = 0.25
_LEAST_FRAMES = 8
_CONVERTED = (
    "the video was converted: it shows about {0:.4g} pictures a second in {1:.4g} frames. Their times were "
    "taken to be even, up to {2:.3f} s from their time stamps; how late all of them are is known to {3:.3f} s"
)
_STAMPED = (
    "the frames have time stamps up to {0:.3f} s off even times, over which the path is smoother: their "
    "times were taken to be even; how late all of them are is known to {1:.3f} s"
)


@dataclass(frozen=True)
class _Found:
    """Even times of a video.

    Attributes:
        at_s: (F,) times of all frames, strictly increasing.
        repeats: (F,) which frames repeat the picture before them; None if none is known to.
        late_s: Standard deviation of what all times may be late by.
        note: What is to be told.
    """

    at_s: FloatArray
    repeats: BoolArray | None
    late_s: float
    note: str


def with_even_times(front_end: FrontEnd, config: Config, progress: Progress) -> tuple[FrontEnd, Config]:
    """Return the front end of pictures at even times, if the video shows any, and settings with what is left.

    Rigs of several cameras keep their times.

    Args:
        front_end: Stages A to C of the video as it is.
        config: Settings.
        progress: Progress display.
    """
    if front_end.others or config.sensors.frame_time_sigma_s:
        return front_end, config
    found = _of_converted(front_end) or _of_stamped(front_end)
    if found is None:
        return front_end, config
    sensors = config.sensors.model_copy(update={"frame_time_sigma_s": found.late_s})
    changed = config.model_copy(update={"sensors": sensors})
    recording = replace(front_end.recording, notes=(*front_end.recording.notes, found.note))
    frame_s = float(np.median(np.diff(front_end.t_s)))
    if np.abs(found.at_s - front_end.t_s).max() < _NOTABLE * frame_s:
        return replace(front_end, recording=recording, warnings=(*front_end.warnings, found.note)), changed
    progress.stage("again with the pictures at the even times that the video shows")
    retimed = replace(recording, video=RetimedVideo(recording.video, found.at_s, found.repeats))
    try:
        return run_front_end(retimed, changed, progress), changed
    except (GeometryError, GpsLogError, np.linalg.LinAlgError):  # the first run had a path
        return front_end, config


def _of_converted(front_end: FrontEnd) -> _Found | None:
    """Return the even times that repeats show, if they show any."""
    t_s, repeats = front_end.t_s, np.zeros(len(front_end.t_s), bool)
    repeats[front_end.repeated_frames] = True
    if not repeats.any():
        return None
    at_s, even = picture_times(t_s, repeats, _views(front_end) | repeats)
    if not even.any():
        return None
    frame_s, picture_s = (float(np.median(np.diff(times_s))) for times_s in (t_s, at_s[even]))
    late_s = _UNKNOWN * picture_s
    off_s = float(np.abs(at_s - t_s).max())
    return _Found(at_s, repeats, late_s, _CONVERTED.format(1.0 / picture_s, 1.0 / frame_s, off_s, late_s))


def _of_stamped(front_end: FrontEnd) -> _Found | None:
    """Return even times over which the path is clearly smoother than over the time stamps."""
    t_s = front_end.t_s
    if len(t_s) < _LEAST_FRAMES:
        return None
    at_s = even_times(t_s)
    late_s = float(np.std(t_s - at_s))
    if late_s < _NOTABLE * float(np.median(np.diff(t_s))):
        return None
    gain = 0.0
    for one in front_end.maps:
        frames, shown = _shown(one)
        place = np.where(shown[:, None], one.poses[:, :3, 3], np.nan)
        gain += smoother_by((t_s[frames], at_s[frames]), place)
    if gain < CLEAR:
        return None
    return _Found(at_s, None, late_s, _STAMPED.format(float(np.abs(t_s - at_s).max()), late_s))


def _views(front_end: FrontEnd) -> BoolArray:
    """Return which frames moved and were tracked (F,): each of them shows a picture of its own."""
    views = np.zeros(len(front_end.t_s), bool)
    for one in front_end.maps:
        frames, shown = _shown(one)
        views[frames] = one.moving & shown
    return views


def _shown(one: LocalMap) -> tuple[IntArray, BoolArray]:
    """Return the frames of a map (n,), and which of them were posed by their picture."""
    frames = one.first_frame + np.arange(len(one.t_s))
    return frames, ~np.isin(frames, list(one.bridged))


def picture_times(t_s: FloatArray, repeats: BoolArray, known: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return times (F,) of frames, strictly increasing, and which (F,) first show pictures at even ones.

    They are even in stretches in which a line is within half a frame of their time stamps, and that is no
    chance, as in a converted video. Others keep theirs, and repeats stay in between. No time moves by more
    than a frame.

    Args:
        t_s: (F,) time stamps.
        repeats: (F,) whether a frame repeats the picture before it.
        known: (F,) whether that is known; it is not where a camera stands, or is lost.
    """
    at_s, even, frame_s = t_s.copy(), np.zeros(len(t_s), bool), float(np.median(np.diff(t_s)))
    edges = np.flatnonzero(np.diff(known.astype(int), prepend=0, append=0))
    for first, end in edges.reshape(-1, 2).tolist():
        # the first picture may have been shown before the stretch
        lead, rows = np.split(first + np.flatnonzero(~repeats[first:end]), [1])
        while len(rows):
            span = rows[: _evenly_spaced(t_s[rows], frame_s)]
            frames = int(span[-1]) + 1 - int(span[0])
            if _chance(frames, frames - len(span)) * len(t_s) < _CHANCE:
                line = _on_line(t_s[span])
                before_s = np.clip(2.0 * line[0] - line[1], t_s[lead] - frame_s, t_s[lead] + frame_s)
                at_s[span], at_s[lead] = line, before_s
                even[span] = even[lead] = True
            lead, rows = rows[:0], rows[len(span) :]
    shown = np.flatnonzero(~repeats)
    close = np.flatnonzero(np.diff(at_s[shown]) < _CLOSE * frame_s)
    for ends in (shown[close], shown[close + 1]):
        at_s[ends] = t_s[ends]
    at_s[repeats] = t_s[repeats] + np.interp(np.flatnonzero(repeats), shown, (at_s - t_s)[shown])
    return at_s, even


def _chance(frames: int, repeats: int) -> float:
    """Return the chance of a pattern of pictures at even times if any frame may repeat one.

    There are about n^3 / pi^2 such patterns of n frames (balanced words: Mignosi, On the number of factors of
    Sturmian words, 1991), and each has the chance of its number of repeats.
    """
    share = repeats / frames
    return frames**3 / np.pi**2 * float(np.exp(-frames * (entr(share) + entr(1.0 - share))))


def _evenly_spaced(t_s: FloatArray, frame_s: float) -> int:
    """Return how many of the first times are within half a frame of a line."""
    most_s = 0.5 * (1.0 + _ROUNDED) * frame_s

    def off_s(count: int) -> float:
        return float(np.abs(t_s[:count] - _on_line(t_s[:count])).max())

    end = 2  # a search among all would take hours for a long video whose pictures are not even
    while end < len(t_s) and off_s(end) <= most_s:
        end = min(2 * end, len(t_s))
    return bisect(range(1, end + 1), most_s, key=off_s)


def _on_line(t_s: FloatArray) -> FloatArray:
    """Return times (n,) on the line whose largest distance from given ones (n,) is the least."""
    if len(t_s) < 3:
        return t_s
    number, since_s = np.linspace(0.0, 1.0, len(t_s)), t_s - t_s[0]
    line, ones = np.column_stack([number, np.ones(len(t_s))]), np.ones((len(t_s), 1))
    found = linprog(
        [0.0, 0.0, 1.0],
        A_ub=np.block([[line, -ones], [-line, -ones]]),
        b_ub=np.concatenate([since_s, -since_s]),
        bounds=(None, None),
    ).x
    assert found is not None, "any line is within some distance"
    return np.asarray(t_s[0] + line @ found[:2])
