"""Runs of `vgps online` on recordings with truth, and the errors of their poses as they came.

The error of a pose is unaligned. It counts from the first pose whose stated sigma is below one metre, or
within a tenth of that of the offsets of fixes. NEES is the squared error over the stated variances, 3 if they
are honest.
"""

import argparse
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

import vgps
from scripts.common.recordings import read_truth
from vgps.config import OnlineConfig
from vgps.geodesy import to_enu
from vgps.geometry import interpolate_poses, rotation_vectors
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.fixes import Fixes, fixes_in_world
from vgps.gps.offset_errors import between_receivers, errors_of
from vgps.gps.offset_regions import with_offset_regions
from vgps.model import BoolArray, FixClass, FloatArray, Recording
from vgps.online import OnlineEstimate, OnlineSmoother
from vgps.online.delay import DelayedEstimates
from vgps.online.replay import replay
from vgps.online.run import FeedItem, TimedImage, run_online
from vgps.readers.gps_formats.fixes import Fix

CERTAIN_M, WITHIN = 1.0, 1.1
LATER_S = 1.0
SETTLED_S = 1.0  # after RTK-fixes return
SIGMAS = 3.0
MEASURES = (
    "since_s",
    "fixes_mean_m",
    "mean_m",
    "max_m",
    "later_mean_m",
    "nees",
    "beyond_three_sigmas",
    "rotation_deg",
    "rotation_nees",
    "returned",
)


@dataclass(frozen=True)
class Truth:
    """True camera and antenna at the frames and fixes of a recording, and its fixes in the same world.

    Attributes:
        world_T_camera: (F, 4, 4) at the frames.
        fix_error_m: (M, 3) fix minus antenna at its time stamp.
        fix_sigma_m: (M,) standard deviation of its offset in space.
    """

    world_T_camera: FloatArray
    fix_error_m: FloatArray
    fix_sigma_m: FloatArray


def truth_of(recording: Recording) -> Truth:
    """Return the truth of a recording with fixes, in the world of its rig.

    Raises:
        VgpsError: There is none.
    """
    found, log, origin = read_truth(recording.path), recording.gps, recording.rig.world_origin
    assert log is not None and origin is not None
    position = to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m)
    poses = interpolate_poses(found.t_s, found.world_T_camera, log.t_s)
    antenna = poses[:, :3, :3] @ recording.rig.camera_p_antenna + poses[:, :3, 3]
    sigma_m = offset_sigmas(fixes_in_world(log, position, vgps.Config().gps))
    frames = interpolate_poses(found.t_s, found.world_T_camera, recording.video.times_s)
    return Truth(frames, position - antenna, np.linalg.norm(sigma_m, axis=1))


def offset_sigmas(fixes: Fixes) -> FloatArray:
    """Return the standard deviations (M, 3) of the offsets of fixes, in the mean over receivers."""
    config = vgps.Config().gps
    spread = np.array([between_receivers(errors) for errors in errors_of(fixes, config)])
    return spread[:, None] * region_sigmas(with_offset_regions(fixes, config))


@dataclass(frozen=True)
class LiveRun:
    """Estimates of all frames as they come, and each with what came in the second after it.

    ``latency_s``: from the frame's arrival to its pose, of each.
    """

    estimates: list[OnlineEstimate]
    later: list[OnlineEstimate]
    latency_s: list[float]


def delayed_fixes(feed: Iterable[FeedItem], delay_s: float) -> Iterator[FeedItem]:
    """Yield a feed whose fixes come some time after they were taken: before the first frame from then on."""
    waiting = deque[Fix]()
    for item in feed:
        if isinstance(item, Fix):
            waiting.append(item)
            continue
        if isinstance(item, TimedImage):
            while waiting and waiting[0].t_s + delay_s <= item.t_s:
                yield waiting.popleft()
        yield item
    yield from waiting


def run_live(recording: Recording, seed: int, delay_s: float = 0.0, *, realtime: bool = False) -> LiveRun:
    """Return the estimates of a run whose fixes come so much later than they were taken.

    With ``realtime`` frames come as those of a camera do: at the video's own pace, and no pose waits for a
    fit.
    """
    config = vgps.Config(seed=seed, online=OnlineConfig(repeatable=not realtime))
    smoother = OnlineSmoother(recording.camera, recording.rig, config, imu=recording.imu)
    delayed, run, stop = DelayedEstimates(smoother, LATER_S), LiveRun([], [], []), threading.Event()

    def sink(estimate: OnlineEstimate, latency_s: float) -> None:
        run.estimates.append(estimate)
        run.latency_s.append(latency_s)
        run.later.extend(one for one, _ in delayed.add(estimate, 0.0))

    feed = replay(recording, stop, realtime=realtime)
    run_online(delayed_fixes(feed, delay_s), smoother, sink, stop)
    run.later.extend(one for one, _ in delayed.rest())
    return run


def add_delay(parser: argparse.ArgumentParser) -> None:
    """Add ``--delay-s``, with which fixes come."""
    help_text = "seconds from when a fix is taken until it comes, as receivers need 0.1 to 0.5"
    parser.add_argument("--delay-s", type=float, default=0.0, help=help_text)


def position_errors(estimates: list[OnlineEstimate], true: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return errors (n, 3) of poses against true positions (F, 3), F >= n, and their sigmas (n, 3)."""
    error_m = np.array([one.global_T_camera[:3, 3] for one in estimates]) - true[: len(estimates)]
    return error_m, np.array([one.sigma_position_m for one in estimates])


def rotation_errors(
    estimates: list[OnlineEstimate], true: FloatArray, rows: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return rotations (n, 3) about east, north and up from true poses (F, 4, 4) to some of their estimates
    (F,), and their sigmas (n, 3), radians.
    """
    chosen = [estimates[row] for row in np.flatnonzero(rows)]
    found = np.array([one.global_T_camera[:3, :3] for one in chosen])
    turn_rad = rotation_vectors(found @ true[: len(rows)][rows, :3, :3].transpose(0, 2, 1))
    return turn_rad, np.array([one.sigma_rotation_rad for one in chosen])


def mean_nees(error: FloatArray, sigma: FloatArray) -> float:
    """Return the mean squared error (n, 3) over the stated variances, 3 if they are honest."""
    return float(np.mean(np.sum((error / sigma) ** 2, axis=1)))


def score(recording: Recording, truth: Truth, run: LiveRun) -> dict[str, float]:
    """Return the ``MEASURES`` of one run, NaN if no pose was ever certain, and its latencies."""
    assert recording.gps is not None
    estimates = run.estimates
    true = truth.world_T_camera[: len(estimates), :3, 3]
    t_s, fix_t_s = recording.video.times_s[: len(estimates)], recording.gps.t_s
    error_m, sigma_m = position_errors(estimates, true)
    later_m = np.linalg.norm(np.array([one.global_T_camera[:3, 3] for one in run.later]) - true, axis=1)
    size, stated = np.linalg.norm(error_m, axis=1), np.linalg.norm(sigma_m, axis=1)
    newest = np.clip(np.searchsorted(fix_t_s, t_s, side="right") - 1, 0, None)
    certain = np.flatnonzero(stated < np.maximum(CERTAIN_M, WITHIN * truth.fix_sigma_m[newest]))
    first = int(certain[0]) if len(certain) else len(t_s)
    counts = np.isfinite(size) & (np.arange(len(t_s)) >= first)
    milliseconds = 1e3 * np.percentile(run.latency_s, [50, 99])
    latency = dict(zip(("pose_p50_ms", "pose_p99_ms"), milliseconds.tolist(), strict=True))
    if not counts.any():
        return dict.fromkeys(MEASURES, np.nan) | latency
    size, stated = size[counts], stated[counts]
    turn_rad, turn_sigma_rad = rotation_errors(estimates, truth.world_T_camera, counts)
    since_s = float(t_s[first])
    return {
        "since_s": since_s,
        "fixes_mean_m": float(np.linalg.norm(truth.fix_error_m[fix_t_s >= since_s], axis=1).mean()),
        "mean_m": float(size.mean()),
        "max_m": float(size.max()),
        "later_mean_m": float(later_m[counts].mean()),
        "nees": mean_nees(error_m[counts], sigma_m[counts]),
        "beyond_three_sigmas": float(np.mean(size > SIGMAS * stated)),
        "rotation_deg": float(np.degrees(np.linalg.norm(turn_rad, axis=1)).mean()),
        "rotation_nees": mean_nees(turn_rad, turn_sigma_rad),
        "returned": after_return(recording, t_s[counts], size),
        **latency,
    }


def after_return(recording: Recording, t_s: FloatArray, error_m: FloatArray) -> float:
    """Return the mean error from a second after the last return of RTK-fixes on, over that before them.

    Args:
        recording: Its fixes tell when; NaN if none returned after others.
        t_s: (n,) times.
        error_m: (n,) errors.
    """
    assert recording.gps is not None
    fixed = np.array([one is FixClass.RTK_FIX for one in recording.gps.fix_class])
    begins, ends = (np.flatnonzero(np.diff(fixed.astype(int)) == step) + 1 for step in (1, -1))
    if not len(begins):
        return float("nan")
    back_s = recording.gps.t_s[begins[-1]]
    lost = ends[ends < begins[-1]]
    lost_s = recording.gps.t_s[lost[-1]] if len(lost) else -np.inf
    before, after = error_m[(t_s >= lost_s) & (t_s < back_s)], error_m[t_s >= back_s + SETTLED_S]
    return float(after.mean() / before.mean()) if len(before) and len(after) else float("nan")
