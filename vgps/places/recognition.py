"""Places of earlier visits recognised in the frames of a live path."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgps.config.loops import LoopsConfig
from vgps.geometry import project
from vgps.model import Camera, FloatArray, Frame
from vgps.places.place_memory import PlaceMemory, Sight, WorldPath
from vgps.places.revisits import allowed
from vgps.places.view import agreed_pose, beside_landmarks, correspondences, described
from vgps.tracking.pose import Correspondences, refine_pose

_RECENT = 20  # frames recognised last that may confirm the next one


@dataclass(frozen=True, kw_only=True)
class SeenLandmarks:
    """Landmarks of a frame: ``uv_px`` (m, 2) undistorted, and ``depth`` (m,) in units of the map."""

    frame: int
    uv_px: FloatArray
    depth: FloatArray


@dataclass(frozen=True, kw_only=True)
class Look:
    """A frame to be compared with the places of earlier visits.

    Attributes:
        image: The frame.
        travelled_m: Distance along the path.
        depth_m: Median depth of its landmarks.
        settled: Frames that were compared earlier and may be remembered, since their landmarks no longer
            change much.
    """

    image: Frame
    travelled_m: float
    depth_m: float
    settled: tuple[SeenLandmarks, ...]


@dataclass(frozen=True, kw_only=True)
class Recognised:
    """A frame in which the landmarks of an earlier one are found again.

    Attributes:
        frame, earlier: Both frames.
        world_T_camera: (4, 4) the later frame's pose by these landmarks.
        sigma: (6,) standard deviations of position, metres, and of rotation, radians, about east, north, up.
        before_m: The largest standard deviation of its position without them.
        travelled_m: Distance along the path.
    """

    frame: int
    earlier: int
    world_T_camera: FloatArray
    sigma: FloatArray
    before_m: float
    travelled_m: float


@dataclass(frozen=True)
class Answer:
    """What a look gives: the distance along the path of the next one, and a place that is sure."""

    next_m: float
    recognised: Recognised | None = None


class PlaceRecogniser:
    """Remembers frames of a path, and recognises them when the path comes back.

    Args:
        camera: Of all frames; replaced between looks where it is refined.
        config: Limits.
        capacity: Places to remember.
    """

    def __init__(self, camera: Camera, config: LoopsConfig, capacity: int) -> None:
        self.camera, self._config = camera, config
        self._memory = PlaceMemory(capacity)
        self._sights: dict[int, Sight] = {}
        self._recent: deque[Recognised] = deque(maxlen=_RECENT)

    def look(self, given: Look, along: Callable[[], WorldPath]) -> Answer:
        """Compare a frame with places of earlier visits.

        Args:
            given: The frame.
            along: Gives the path until this frame.
        """
        config, path = self._config, along()
        for landmarks in given.settled:
            self._remember(landmarks)
        self._memory.update(path)
        uv, descriptors = described(given.image, self.camera, config.features)
        sight = Sight(
            frame=given.image.index,
            travelled_m=given.travelled_m,
            depth_m=given.depth_m,
            uv_px=uv,
            descriptors=descriptors,
        )
        self._sights[sight.frame] = sight
        near = self._memory.near(sight, path, config)
        if not len(near):
            return Answer(sight.travelled_m + config.reach * sight.depth_m)
        next_m = sight.travelled_m + config.spacing * sight.depth_m
        rows = self._memory.candidates(sight, near, config.candidates).tolist()
        found = [one for row in rows if (one := self._compared(row, sight))]
        if not found:
            return Answer(next_m)
        row, pose, matches = max(found, key=lambda one: len(one[2]))
        best = self._recognised(row, sight, refined(self.camera.K, pose, matches), path)
        sigma_m = float(self._memory.sigma_m(path)[row])
        if not allowed(best.world_T_camera, path.poses[-1], sigma_m, sight.depth_m, config):
            return Answer(next_m)
        sure = self._is_confirmed(best, path, sight.depth_m)
        self._recent.append(best)
        return Answer(next_m, best if sure else None)

    def _remember(self, landmarks: SeenLandmarks) -> None:
        sight = self._sights.pop(landmarks.frame, None)
        self._sights = {frame: one for frame, one in self._sights.items() if frame > landmarks.frame}
        if sight is None:
            return
        rows, points = beside_landmarks(
            sight.uv_px, landmarks.uv_px, landmarks.depth, self.camera.K, self._config.reach_px
        )
        if len(rows) >= self._config.min_inliers:
            self._memory.add(sight, rows, points)

    def _compared(self, row: int, sight: Sight) -> tuple[int, FloatArray, Correspondences] | None:
        """Return a place, a frame's pose by it, and the features that agree on it; None if too few do."""
        descriptors, points = self._memory.features(row)
        matches = correspondences(descriptors, points, sight.descriptors, sight.uv_px, self._config.ratio)
        agreed = agreed_pose(self.camera.K, matches, self._config)
        return None if agreed is None else (row, *agreed)

    def _recognised(
        self, row: int, sight: Sight, located: tuple[FloatArray, FloatArray], path: WorldPath
    ) -> Recognised:
        """Return a frame with its pose (4, 4) by the landmarks of a place, whose covariance (6, 6) without
        the errors of the place is given too."""
        pose, matched = located
        R, earlier = pose[:3, :3], np.diagonal(self._memory.covariance[row])
        away_m = np.linalg.norm(pose[:3, 3] - self._memory.pose[row, :3, 3])
        position = earlier[:3] + np.diagonal(R @ matched[3:, 3:] @ R.T) + away_m**2 * earlier[3:].max()
        rotation = earlier[4:] + np.diagonal(R @ matched[:3, :3] @ R.T)
        return Recognised(
            frame=sight.frame,
            earlier=int(self._memory.frame[row]),
            world_T_camera=pose,
            sigma=np.sqrt(np.concatenate([position, rotation])),
            before_m=path.sigma_m,
            travelled_m=sight.travelled_m,
        )

    def _is_confirmed(self, found: Recognised, path: WorldPath, depth_m: float) -> bool:
        """Whether places recognised just before are off by about the same."""
        config, agree = self._config, 0
        now = found.world_T_camera[:3, 3] - path.poses[-1, :3, 3]
        for one in self._recent:
            row, between_m = one.frame - path.first_frame, found.travelled_m - one.travelled_m
            if row < 0 or between_m > config.apart * depth_m:
                continue
            off = one.world_T_camera[:3, 3] - path.poses[row, :3, 3]
            allowed_m = 0.5 * config.slack * depth_m + config.neighbour_drift * between_m
            agree += bool(np.linalg.norm(off - now) < allowed_m)
        return agree >= config.neighbours


def refined(K: FloatArray, pose: FloatArray, matches: Correspondences) -> tuple[FloatArray, FloatArray]:
    """Return the pose (4, 4) that fits matches best, and its covariance (6, 6) in the camera's tangent.

    The error of a match is the root mean square of all, since corners and depths both err.
    """
    pose, information = refine_pose(K, pose, matches, np.ones(len(matches)))
    uv, _ = project(K, pose, matches.points)
    variance = np.sum((uv - matches.uv_px) ** 2) / max(2 * len(matches) - 6, 1)
    # the information is that of mu = 1, and mu is 1 / (2 sigma^2)
    return pose, 2.0 * variance * np.linalg.inv(information)
