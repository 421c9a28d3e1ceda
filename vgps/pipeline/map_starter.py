"""The start of a map: features are followed without positions until two views give their positions."""

import numpy as np

from vgps.config import Config
from vgps.imu.rotation import RotationPredictor
from vgps.mapping.between_views import pose_between_views
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView
from vgps.mapping.retention import RetentionPolicy
from vgps.model import Camera, Frame
from vgps.pipeline.map_builder import MapBuilder
from vgps.tracking.bootstrap import TwoViewInitialiser
from vgps.tracking.frame_tracker import FrameTracker
from vgps.tracking.mapper import Mapper

_UNKNOWN = np.full((4, 4), np.nan)


class MapStarter:
    """Extension of a map by frames until two views start it.

    Args:
        stages: Stages A and B.
        camera: The camera.
        config: Settings.
        rng: Random generator, the one of the stages.
        retention: Policy that limits how long a frame may go without a view, if any.
    """

    def __init__(
        self,
        stages: tuple[FrameTracker, Mapper],
        camera: Camera,
        config: Config,
        rng: np.random.Generator,
        retention: RetentionPolicy | None,
    ) -> None:
        self._tracker, self._mapper = stages
        self._config, self._retention = config, retention
        self._initialiser = TwoViewInitialiser(camera, config.start, config.tracking, rng)

    def add_frame(
        self, builder: MapBuilder | None, frame: Frame, gyro: RotationPredictor | None = None
    ) -> MapBuilder | None:
        """Add a frame to a map that has not started, or begin one with it.

        A gyro says where to search its features.

        Returns:
            The map, ``started`` if this frame started it; a new one if too few features were found again;
            None if the frame shows too few corners.
        """
        if builder is None:
            return self._first_view(frame)
        local_map, config = builder.local_map, self._config
        rotation = None if gyro is None else gyro.between(builder.view_s, frame.t_s)
        result = self._tracker.follow(local_map, builder.view_image, frame, rotation)
        if result.found.sum() < config.start.min_inliers:
            return self._first_view(frame)
        again = bool(local_map.bridged)  # nothing else is bridged before a map starts
        if builder.shows_repeats(frame, result, config.tracking, again):
            builder.bridge(builder.discard_repeats(), frame.t_s)
        if not builder.extend(frame, result, config.tracking, self._retention):
            return builder
        start = self._initialiser.initialise(local_map)
        if start is not None:
            local_map.apply(start)
        local_map.apply(self._mapper.new_features(local_map, frame))
        if start is not None:
            builder.started = True
            local_map.apply(pose_between_views(local_map))
        return builder

    def _first_view(self, frame: Frame) -> MapBuilder | None:
        local_map = LocalMap(frame.index, self._config.mapping.max_track_frames)
        no_pixels = np.zeros((0, 2))
        view = NewView(frame.index, no_pixels, no_pixels, np.zeros(0, dtype=bool))
        local_map.apply(MapUpdate(frames=(NewFrame(frame.t_s, _UNKNOWN),), view=view))
        local_map.apply(self._mapper.new_features(local_map, frame))
        if len(local_map.ids) < self._config.start.min_inliers:
            return None
        return MapBuilder(local_map=local_map, view_image=frame.gray)
