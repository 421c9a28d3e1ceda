"""Loops: frames in which landmarks of an earlier visit are found again."""

import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import IO

import numpy as np

from vgps.camera import undistort
from vgps.config.loops import LoopsConfig
from vgps.model import BoolArray, FloatArray, Frame, IntArray
from vgps.places.revisits import PosedVideo, allowed, revisits
from vgps.places.view import View, agreed_pose, followed, make_view, matched, on_disk
from vgps.places.words import WordIndex
from vgps.tracking.pose import Correspondences, refine_pose


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A frame in which landmarks of an earlier one are found again.

    Attributes:
        frame: The later frame.
        earlier: The earlier one.
        world_T_camera: (4, 4) the later frame's pose by these landmarks.
        landmark: (n,) the landmarks.
        raw_uv_px: (n, 2) where the later frame shows them, in the distorted image.
    """

    frame: int
    earlier: int
    world_T_camera: FloatArray
    landmark: IntArray
    raw_uv_px: FloatArray


def find_loops(video: PosedVideo, frames: Iterable[Frame], config: LoopsConfig) -> tuple[Loop, ...]:
    """Find the landmarks of earlier visits in the frames of later ones.

    No frame is decoded unless the path may come back to a place. Candidates are near each other by the path
    and its sigmas, agree in appearance (ORB) and geometry (pose by the earlier landmarks), lie where the
    path's sigmas allow, and are confirmed by their neighbours in time.

    Args:
        video: The solution so far.
        frames: All frames, in order.
        config: Limits.
    """
    pairs = revisits(video, config)
    if not len(pairs):
        return ()
    wanted = set(pairs.ravel().tolist())
    # images of a long drive through known streets would not fit in memory
    with tempfile.TemporaryFile(prefix="vgps-places-") as images:
        found = _matching(video, (frame for frame in frames if frame.index in wanted), pairs, images, config)
    confirmed = _confirmed(found, video, config)
    return tuple(loop for loop, good in zip(found, confirmed.tolist(), strict=True) if good)


def _matching(
    video: PosedVideo, frames: Iterable[Frame], pairs: IntArray, images: IO[bytes], config: LoopsConfig
) -> list[Loop]:
    """Return the loops that appearance and geometry show; ``pairs`` (n, 2) are the candidates."""
    last_use = dict(zip(pairs[:, 1].tolist(), pairs[:, 0].tolist(), strict=True))  # pairs are in this order
    views: dict[int, View] = {}
    index = WordIndex()
    found: list[Loop] = []
    for frame in frames:
        view = make_view(frame, video, config)
        words = index.words(view.descriptors)
        earlier = pairs[pairs[:, 0] == frame.index, 1]
        earlier = earlier[index.candidates(words, earlier, config.candidates)]
        if (loop := _best([views[k] for k in earlier.tolist()], view, video, config)) is not None:
            found.append(loop)
        if frame.index in last_use:
            views[frame.index] = replace(view, gray=on_disk(frame.gray, images), mask=None)
            index.add(frame.index, words)
        for done in [k for k in views if last_use[k] <= frame.index]:
            del views[done]
            index.discard(done)
        if frame.index == pairs[-1, 0]:
            break
    return found


def _best(candidates: Sequence[View], view: View, video: PosedVideo, config: LoopsConfig) -> Loop | None:
    """Return the loop to the candidate of which most landmarks are found; None if no candidate gives one."""
    loops = [_loop(earlier, view, video, config) for earlier in candidates]
    return max((loop for loop in loops if loop), key=lambda loop: len(loop.landmark), default=None)


def _loop(earlier: View, later: View, video: PosedVideo, config: LoopsConfig) -> Loop | None:
    K = video.camera.K
    agreed = agreed_pose(K, matched(earlier, later, config.ratio), config)
    if agreed is None:
        return None
    pose, _ = agreed
    sigma_m = float(np.hypot(video.sigma_m[earlier.frame], video.sigma_m[later.frame]))
    if not allowed(pose, video.poses[later.frame], sigma_m, video.depth[later.frame], config):
        return None
    rows, raw = followed(earlier, later, pose, video)
    least = max(config.min_inliers, config.min_share * len(rows))
    rows, raw = rows[np.isfinite(raw[:, 0])], raw[np.isfinite(raw[:, 0])]
    uv = undistort(video.camera, raw)
    landmarks = Correspondences(video.points[earlier.landmark[rows]], uv)
    near = landmarks.inliers(K, pose, config.inlier_px)
    if near.sum() < least:
        return None
    pose, _ = refine_pose(K, pose, landmarks.where(near), np.ones(int(near.sum())))
    good = landmarks.inliers(K, pose, config.inlier_px)
    if good.sum() < least:
        return None
    return Loop(
        frame=later.frame,
        earlier=earlier.frame,
        world_T_camera=pose,
        landmark=earlier.landmark[rows[good]],
        raw_uv_px=raw[good],
    )


def _confirmed(loops: Sequence[Loop], video: PosedVideo, config: LoopsConfig) -> BoolArray:
    """Return which loops (n,) have neighbours that are off by about the same."""
    if not loops:
        return np.zeros(0, bool)
    frames = np.array([loop.frame for loop in loops])
    off = np.stack([loop.world_T_camera[:3, 3] for loop in loops]) - video.poses[frames, :3, 3]
    path, depth = video.travelled[frames], video.depth[frames]
    between = np.abs(path[:, None] - path)
    differ = np.linalg.norm(off[:, None] - off, axis=2)
    near = between < config.reach * depth[:, None]
    agree = near & (differ < 0.5 * config.slack * depth[:, None] + config.neighbour_drift * between)
    return np.asarray(agree.sum(axis=1) - 1 >= config.neighbours)
