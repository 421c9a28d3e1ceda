"""Stages A and B of one camera: a pose for a frame, and the same stages for a refined camera."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.mapping.local_map import LocalMap
from vgps.mapping.retention import RetentionPolicy
from vgps.model import Camera, Frame
from vgps.pipeline.map_builder import MapBuilder
from vgps.pipeline.map_starter import MapStarter
from vgps.tracking.frame_tracker import FrameTracker
from vgps.tracking.mapper import Mapper
from vgps.tracking.pose import Prediction
from vgps.tracking.tracking_result import TrackingResult


@dataclass(frozen=True, kw_only=True)
class FrameStages:
    """Stages A and B, and what starts maps with them.

    Attributes:
        camera: The camera.
        config: Settings.
        rng: Random generator of the stages.
        retention: Policy that limits how long a frame may go without a view, if any.
        live: Whether poses are given out frame by frame.
        tracker, mapper: Stage A, stage B.
        starter: What starts maps with them.
    """

    camera: Camera
    config: Config
    rng: np.random.Generator
    retention: RetentionPolicy | None
    live: bool
    tracker: FrameTracker
    mapper: Mapper
    starter: MapStarter

    @classmethod
    def of(
        cls,
        camera: Camera,
        config: Config,
        rng: np.random.Generator,
        retention: RetentionPolicy | None,
        live: bool = False,
    ) -> "FrameStages":
        """Return the stages for a camera."""
        tracker = FrameTracker(camera, config.tracking, config.mapping, rng)
        mapper = Mapper(camera, config.tracking, config.mapping, rng)
        starter = MapStarter((tracker, mapper), camera, config, rng, retention)
        return cls(
            camera=camera,
            config=config,
            rng=rng,
            retention=retention,
            live=live,
            tracker=tracker,
            mapper=mapper,
            starter=starter,
        )

    def with_camera(self, camera: Camera, maps: Sequence[LocalMap]) -> "FrameStages":
        """Return the stages for a refined camera, which go on with what the tracker knows of the maps."""
        stages = FrameStages.of(camera, self.config, self.rng, self.retention, self.live)
        stages.tracker.restore(self.tracker.state(maps))
        return stages

    def pose(self, builder: MapBuilder, frame: Frame, predicted: Prediction) -> TrackingResult:
        """Pose a frame by the features of a map, which a lost camera searches in the whole frame."""
        local_map = builder.local_map
        result = self.tracker.track(local_map, builder.view_image, frame, predicted)
        if result.world_T_camera is None:
            searched = self.camera, self.config.tracking, self.rng
            if (found := builder.located(frame, predicted.world_T_camera, *searched)) is not None:
                result = self.tracker.track(local_map, builder.view_image, frame, found)
        return result
