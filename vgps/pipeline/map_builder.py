"""A map under construction: its newest view, frames without a view, gaps, and when stage C is due."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.config import TrackingConfig
from vgps.geometry import interpolate_poses
from vgps.imu.rotation import BIAS_FRAMES, RotationPredictor
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView
from vgps.mapping.retention import RetentionPolicy
from vgps.mapping.trajectory import map_trajectory
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import Camera, FloatArray, Frame, GrayImage
from vgps.solution import Trajectory
from vgps.tracking.frame_tracker import FrameTracker
from vgps.tracking.mapper import Mapper
from vgps.tracking.pose import Prediction
from vgps.tracking.relocaliser import Relocaliser
from vgps.tracking.tracking_result import TrackingResult

_STANDING_SIGMA = np.array([1e-3] * 3 + [1e-2] * 3)  # rad and map units, before the map has poses
_UNKNOWN = np.full((4, 4), np.nan)
_MIN_SIGMA = 1e-6  # keeps the information of a pose finite
_LONGEST_PREDICTION = 1.5  # frame intervals; after a longer gap the last pose is the prediction
_SAME_PICTURE_PX = 0.05  # features of the same picture, encoded again, move by less
_LEAP = 1.5  # steps at the speed before: one that stood goes on by one at most, after a repeat it is two
_LEAP_AGAIN = 0.5  # in a video that has repeated pictures: a camera that brakes hard goes less than two steps
_LEAST_STEP_PX = 1.0  # before and after a single frame, in which no camera stops and starts again
_LEAST_LEAP_PX = 2.0  # more than a vehicle moves in the first frame of a start
_LONGEST_CARRIED_S = 0.5  # at constant velocity: an acceleration of 1 m/s^2 makes 0.1 m of it


@dataclass(kw_only=True)
class MapBuilder:
    """A map and the state that is needed to extend it.

    Attributes:
        local_map: The map.
        view_image: Image of its newest view.
        started: Whether two views have started the map.
        since_window: Number of moving frames since stage C last began.
        window_at: Number of frames of the video at that time.
        carried_s: Time since the last frame that features posed.
        failures: Number of failures of stage C in a row.
        moved: Whether a moving frame was added since stage C was last considered.
        relocaliser: Searches for the map's features while tracking is lost.
        unmapped: The newest view and its result, if stage B has not run on it.
        speed_px_s: Speed of the median feature between the last two views; NaN before there are two.
        largest_motion_px: Of the median feature since the newest view, in frames that add no view.
        known_repeats: Number of newest frames that are known to repeat a picture.
    """

    local_map: LocalMap
    view_image: GrayImage
    started: bool = False
    since_window: int = 0
    window_at: int = 0
    carried_s: float = 0.0
    failures: int = 0
    moved: bool = False
    relocaliser: Relocaliser | None = None
    unmapped: tuple[Frame, TrackingResult] | None = None
    speed_px_s: float = np.nan
    largest_motion_px: float = 0.0
    known_repeats: int = 0

    @property
    def view_s(self) -> float:
        """Time of the newest view."""
        return float(self.local_map.t_s[int(self.local_map.view_frames[-1]) - self.local_map.first_frame])

    def add_pose(self, t_s: float, world_T_camera: FloatArray) -> None:
        """Append the next frame's pose, NaN if it is unknown."""
        self.local_map.apply(MapUpdate(frames=(NewFrame(t_s, world_T_camera),)))

    def add_view(self, frame: Frame, result: TrackingResult) -> None:
        """Make the newest frame a view, from which features are followed from now on."""
        view = NewView(frame.index, result.raw_uv_px, result.uv_px, result.found)
        self.local_map.apply(MapUpdate(view=view))
        self.view_image = frame.gray

    def extend(
        self, frame: Frame, result: TrackingResult, config: TrackingConfig, retention: RetentionPolicy | None
    ) -> bool:
        """Append the next frame, whose pose is unknown before the map has started.

        Returns:
            Whether it became a view; a frame that stands is constrained to the newest one instead.
        """
        self.add_pose(frame.t_s, _UNKNOWN if result.world_T_camera is None else result.world_T_camera)
        self.known_repeats = self.known_repeats + 1 if frame.repeats else 0
        if self._stands(frame, result, config, retention):
            self.largest_motion_px = max(self.largest_motion_px, self._moved_px(result))
            self.add_zero_motion(frame.index, result)
            return False
        self.speed_px_s, self.largest_motion_px = self._moved_px(result) / (frame.t_s - self.view_s), 0.0
        self.add_view(frame, result)
        return True

    def map_view(self, tracker: FrameTracker, mapper: Mapper) -> None:
        """Run stage B on the newest view, unless it did: features found again, positions, new features."""
        if self.unmapped is None:
            return
        (frame, result), self.unmapped, local_map = self.unmapped, None, self.local_map
        local_map.apply(tracker.find_returning(local_map, frame, result))
        local_map.apply(mapper.triangulate_due(local_map))
        local_map.apply(tracker.moving.leave_out(local_map))
        local_map.apply(mapper.new_features(local_map, frame, tracker.moving))

    def _stands(
        self, frame: Frame, result: TrackingResult, config: TrackingConfig, retention: RetentionPolicy | None
    ) -> bool:
        """Return whether a frame needs no view: its median feature hardly moved since the newest view.

        Under a retention policy a long stop gets a new view before the newest one is discarded.
        """
        if retention is not None and frame.t_s - self.view_s > 0.5 * retention.path_s:
            return False
        return self._moved_px(result) < config.static_px

    def _moved_px(self, result: TrackingResult) -> float:
        """Return how far the median feature moved since the newest view; NaN if none was found."""
        moved = np.linalg.norm(result.raw_uv_px - self.local_map.raw_uv_px, axis=1)[result.found]
        return float(np.median(moved)) if len(moved) else np.nan

    def shows_repeats(
        self, frame: Frame, result: TrackingResult, config: TrackingConfig, again: bool = False
    ) -> bool:
        """Return whether frames since the newest view repeat its picture, by the frame after them.

        Nothing moves in them, and this frame is further from the view than one step, or lost: a camera that
        stood would go on from where it was. Nothing stands for a single frame between two that move.

        Args:
            frame: The frame after them.
            result: Of stage A for this frame.
            config: The motion of a frame that stands.
            again: Whether the video has repeated pictures before.
        """
        if frame.repeats or not self._same_picture():
            return False
        count = self.local_map.next_frame - 1 - int(self.local_map.view_frames[-1])
        if self.known_repeats == count:
            return True
        step_px = self.speed_px_s * (frame.t_s - float(self.local_map.t_s[-1]))
        single = count == 1 and step_px > _LEAST_STEP_PX
        least_px = max(_LEAST_STEP_PX if single else _LEAST_LEAP_PX, config.static_px)
        steps = _LEAP_AGAIN if again or single else _LEAP
        leapt = step_px > 0.0 and self._moved_px(result) > max(least_px, steps * step_px)
        return leapt or (self.started and result.world_T_camera is None)

    def ends_in_repeats(self, config: TrackingConfig) -> bool:
        """Return whether the last frames repeat a picture of a camera that moved, in a video that did so."""
        if not self._same_picture():
            return False
        first = int(self.local_map.view_frames[-1]) + 1 - self.local_map.first_frame
        step_px = self.speed_px_s * (float(self.local_map.t_s[first]) - self.view_s)
        return step_px > max(_LEAST_LEAP_PX, config.static_px)

    def _same_picture(self) -> bool:
        """Return whether there are frames since the newest view, and nothing moves in them."""
        newest, end = int(self.local_map.view_frames[-1]), self.local_map.next_frame
        if end == newest + 1 or self.largest_motion_px > _SAME_PICTURE_PX:
            return False
        return {motion.frame for motion in self.local_map.zero_motions}.issuperset(range(newest + 1, end))

    def discard_repeats(self) -> FloatArray:
        """Remove the frames since the newest view, and return their times (n,)."""
        newest = int(self.local_map.view_frames[-1])
        times_s = self.local_map.t_s[newest + 1 - self.local_map.first_frame :].copy()
        self.local_map.apply(MapUpdate(end=newest + 1))
        return times_s

    def add_zero_motion(self, frame: int, result: TrackingResult) -> None:
        """Constrain a standing frame to the newest view: by its tracked pose, or to no motion without one.

        A frame has no pose before the map has started.
        """
        reference = int(self.local_map.view_frames[-1])
        relative, sigma = np.eye(4), _STANDING_SIGMA
        if result.world_T_camera is not None and result.pose_sigma is not None:
            relative = np.linalg.inv(self.local_map.pose(reference)) @ result.world_T_camera
            sigma = np.maximum(result.pose_sigma, _MIN_SIGMA)
        self.local_map.apply(MapUpdate(zero_motions=(ZeroMotion(frame, reference, relative, sigma),)))

    def predict(
        self, t_s: float, gyro: RotationPredictor | None = None, maps: Sequence[LocalMap] = ()
    ) -> Prediction:
        """Return the pose (4, 4) at a time by the velocity between the last two frames, and by the gyro.

        After a gap, or without two poses, the velocity counts as unknown. The gyro gives the rotation where
        it has samples.

        Args:
            t_s: The time.
            gyro: The gyro.
            maps: All maps in order of time, this one the last: the one before shows the gyro's bias too.
        """
        predicted = self._at_constant_velocity(t_s)
        turn = None if gyro is None else gyro.predict(_joined(maps or (self.local_map,)), t_s)
        if turn is None:
            return Prediction(predicted)
        predicted[:3, :3] = self.local_map.poses[-1, :3, :3] @ turn.rotation
        return Prediction(predicted, turn.sigma_rad)

    def carried(
        self, frame: Frame, result: TrackingResult, prediction: Prediction, config: TrackingConfig
    ) -> TrackingResult:
        """Return the result of stage A; a lost frame gets its predicted pose if a gyro gave the rotation.

        In fast turns features come and go before they have positions: once they have, they hold the frame.

        Args:
            frame: The frame.
            result: With or without a pose.
            prediction: Pose by velocity and gyro.
            config: How many features, and which share of them, have to be found.

        Returns:
            The result; without a pose after a gap, after half a second, or if too few features were found.
        """
        if result.world_T_camera is not None:
            self.carried_s = 0.0
            return result
        carried_s = self.carried_s + frame.t_s - float(self.local_map.t_s[-1])
        least = max(config.min_inliers, config.min_inlier_share * len(result.found))
        gap = frame.index > self.local_map.next_frame
        if gap or not prediction.by_gyro or result.found.sum() < least or carried_s > _LONGEST_CARRIED_S:
            return result
        self.carried_s = carried_s
        return replace(result, world_T_camera=prediction.world_T_camera)

    def _at_constant_velocity(self, t_s: float) -> FloatArray:
        poses, times = self.local_map.poses, self.local_map.t_s
        last, previous = poses[-1].copy(), poses[-2]
        if not np.isfinite(previous[0, 0]):
            return np.asarray(last)
        intervals = (t_s - times[-1]) / (times[-1] - times[-2])
        if intervals >= _LONGEST_PREDICTION:
            return np.asarray(last)
        predicted = last @ np.linalg.inv(previous) @ last
        # errors of rounding would double with each frame, where the one before it was interpolated
        predicted[:3, :3] = gtsam.Rot3.ClosestTo(predicted[:3, :3]).matrix()
        return np.asarray(predicted)

    def located(
        self,
        frame: Frame,
        predicted: FloatArray,
        camera: Camera,
        config: TrackingConfig,
        rng: np.random.Generator,
    ) -> Prediction | None:
        """Search for the features of the newest view in the whole frame, whose pose may be ``predicted``."""
        if self.relocaliser is None:
            self.relocaliser = Relocaliser(camera, config, rng, self.view_image, self.local_map)
        pose = self.relocaliser.locate(frame.gray, predicted)
        return None if pose is None else Prediction(pose)

    def bridge(self, times_s: FloatArray, t_s: float, world_T_camera: FloatArray | None = None) -> None:
        """Append frames after the newest one, posed by interpolation.

        Args:
            times_s: (n,) their times.
            t_s: Time of the frame after them.
            world_T_camera: (4, 4) its pose; None before the map starts, which leaves them without one.
        """
        poses = np.full((len(times_s), 4, 4), np.nan)
        if len(times_s) and world_T_camera is not None:
            ends = np.stack([self.local_map.poses[-1], world_T_camera])
            poses = interpolate_poses(np.array([self.local_map.t_s[-1], t_s]), ends, times_s)
        frames = (NewFrame(float(t), pose, True) for t, pose in zip(times_s, poses, strict=True))
        self.local_map.apply(MapUpdate(frames=tuple(frames)))


def _joined(maps: Sequence[LocalMap]) -> Trajectory:
    """Return the last frames of the last two maps, as many as show a gyro's bias."""
    paths = [map_trajectory(one) for one in maps[-2:]]
    poses = np.concatenate([path.world_T_camera[-BIAS_FRAMES:] for path in paths])
    return Trajectory(np.concatenate([path.t_s[-BIAS_FRAMES:] for path in paths]), poses)
