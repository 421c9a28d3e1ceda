"""Places seen again in a live video, looked for in a thread beside the frames."""

from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vgps.config import Config
from vgps.mapping.local_map import LocalMap
from vgps.model import Camera, Frame, GrayImage
from vgps.online.estimate import OnlineEvent
from vgps.online.fusion.live_fusion import LiveFusion
from vgps.online.fusion.path_fusion import FusedPath
from vgps.online.fusion.place_ties import PlaceTies
from vgps.online.fusion.video_path import VideoPath
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.places.place_memory import WorldPath
from vgps.places.recognition import Answer, Look, PlaceRecogniser, Recognised, SeenLandmarks
from vgps.runtime.threads import begin

_ANSWER_FRAMES = 4  # after which an answer is used, however quickly it was found: results repeat
_SETTLED_FRAMES = 30  # after which stage C has refined the landmarks of a frame twice
_BETTER = 0.5  # of the standard deviation: so much better must the earlier visit be known


@dataclass(frozen=True)
class _Job:
    """A frame that is compared with places."""

    due_frame: int
    answer: "Future[Answer]"

    def counts(self, frames: int, repeatable: bool) -> bool:
        """Return whether it is used after so many frames: when it is due, or else not before it is found."""
        return frames >= self.due_frame and (repeatable or self.answer.done())


class LivePlaces:
    """Lets the poses of earlier visits count where the path in the world is known less well.

    Both visits may have the same errors. So a place counts only if its standard deviation is at most half of
    that of the newest pose before it came back, and of places that were passed within ``online.keep_s`` of
    each other only the one seen last does.

    Args:
        frame_pipeline: Stages A to C.
        fusion: Takes the places.
        camera: Of the video.
        config: Settings.
    """

    def __init__(
        self, frame_pipeline: FramePipeline, fusion: LiveFusion, camera: Camera, config: Config
    ) -> None:
        self._frame_pipeline, self._fusion, self._config = frame_pipeline, fusion, config
        self._recogniser = PlaceRecogniser(camera, config.loops, config.online.places)
        self._job: _Job | None = None
        self._map: LocalMap | None = None
        self._travelled_m = self._next_m = 0.0
        self._unsettled: list[int] = []
        self._settled: list[SeenLandmarks] = []  # to be remembered at the next look
        self._visits: list[Recognised] = []

    def see(self, image: GrayImage) -> list[OnlineEvent]:
        """Use an answer that is due, begin to look for the newest frame (H, W), and return the events."""
        pipeline, current = self._frame_pipeline, self._frame_pipeline.current
        if self._config.loops.close == "no":
            return []
        events = []
        repeatable = self._config.online.repeatable
        if self._job is not None and self._job.counts(len(pipeline.t_s), repeatable):
            events, self._job = self._use(self._job), None
        if current is None or current.next_frame != len(pipeline.t_s):
            return events
        if current is not self._map:
            self._map, self._unsettled, self._settled = current, [], []
        self._settle(current)
        moved = float(np.linalg.norm(current.odometry[-1]))
        self._travelled_m += moved if np.isfinite(moved) else 0.0
        if self._job is None and self._travelled_m >= self._next_m:
            placed = self._fusion.placed()
            if placed is not None:
                self._begin(current, image, *placed)
        return events

    def _settle(self, current: LocalMap) -> None:
        """Take the landmarks of frames that have settled, before the map forgets that these observe them."""
        settled = [one for one in self._unsettled if one < current.next_frame - _SETTLED_FRAMES]
        self._unsettled = self._unsettled[len(settled) :]
        self._settled += [_landmarks(current, one) for one in settled if one >= current.first_frame]

    def _begin(self, current: LocalMap, image: GrayImage, fused: FusedPath, path: VideoPath) -> None:
        """Look for the newest frame of a map in a thread."""
        frame, t_s = current.next_frame - 1, float(current.t_s[-1])
        newest = _landmarks(current, frame)
        if len(newest.depth) < self._config.loops.min_inliers:
            return
        settled, self._settled = tuple(self._settled), []
        self._unsettled.append(frame)
        look = Look(
            image=self._frame_pipeline.tracker.static.masked(Frame(frame, t_s, image)),
            travelled_m=self._travelled_m,
            depth_m=float(np.median(newest.depth)),
            settled=settled,
        )
        self._recogniser.camera = self._frame_pipeline.camera
        along = partial(_in_world, fused, path, current.next_frame - len(path.t_s))
        due_frame = len(self._frame_pipeline.t_s) + _ANSWER_FRAMES
        self._job = _Job(due_frame, begin(self._recogniser.look, look, along))

    def _use(self, job: _Job) -> list[OnlineEvent]:
        """Wait for an answer, let a place count instead of others of the same visit, and return the event of
        the first one."""
        t_s, keep_s = self._frame_pipeline.t_s, self._config.online.keep_s
        try:
            answer = job.answer.result()
        except np.linalg.LinAlgError:  # what was seen does not determine the pose; the next frame may
            return []
        self._next_m = answer.next_m
        if (found := answer.recognised) is None:
            return []
        recent = [one for one in self._visits if t_s[one.frame] > t_s[-1] - keep_s]
        apart = [abs(t_s[one.earlier] - t_s[found.earlier]) >= keep_s for one in recent]
        same = [one for one, other in zip(recent, apart, strict=True) if not other]
        found = replace(found, before_m=max([found.before_m, *(one.before_m for one in same)]))
        if found.sigma[:3].max() > _BETTER * found.before_m:
            return []
        self._visits = [*(one for one, other in zip(recent, apart, strict=True) if other), found]
        self._fusion.tie(
            PlaceTies(
                t_s=np.array([t_s[one.frame] for one in self._visits]),
                world_T_camera=np.stack([one.world_T_camera for one in self._visits]),
                sigma=np.stack([one.sigma for one in self._visits]),
            )
        )
        if same:
            return []
        earlier_s = float(t_s[found.earlier])
        text = f"the place of {earlier_s:.2f} s is seen again"
        details = {"earlier_s": earlier_s, "before_m": found.before_m}
        return [OnlineEvent(float(t_s[-1]), "place", text, details)]


def _in_world(fused: FusedPath, path: VideoPath, first_frame: int) -> WorldPath:
    """Return what a fit says of a path, whose first frame has this number."""
    return WorldPath(
        first_frame=first_frame,
        poses=fused.world_T_camera(path),
        scale=fused.scales_at(path.t_s),
        covariance=fused.covariances_at(path.t_s),
    )


def _landmarks(current: LocalMap, frame: int) -> SeenLandmarks:
    """Return the landmarks that a frame of a map observes."""
    seen = current.observations(frame)
    seen = seen.rows(seen.frame == frame)
    pose = current.pose(frame)
    depth = (current.points[seen.landmark] - pose[:3, 3]) @ pose[:3, 2]
    ahead = depth > 0.0
    return SeenLandmarks(frame=frame, uv_px=seen.uv_px[ahead], depth=depth[ahead])
