"""The camera's calibration, refined by the video while it runs.

A calibration that is off by a pixel or two towards the corners lets the scale of the path drift in every
turn. What the last hundred frames show of it takes some tenths of a second.
"""

from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.mapping.retention import RetentionPolicy
from vgps.model import Camera, FloatArray, IntArray
from vgps.runtime.threads import begin
from vgps.smoothing.calibration.refined_camera import CameraPrior, RefinedCamera, prior_about
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.few_frames import for_few_frames, frame_step, held_frames
from vgps.smoothing.scene.other_calibration import seen_by, undistorted_again
from vgps.smoothing.scene.scene import Scene, scene_of_map
from vgps.smoothing.scene.stops import with_stops, without_stops
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.smoothing.stage_d.intrinsics import estimate_camera

# A calibration improves with the ratio of its frames to those of the one before, so the numbers grow
# geometrically: by half is soon after an early, coarse calibration, yet with enough new frames.
_NEXT = 1.5  # times the frames of one calibration are those of the next
_STEP_ITERATIONS = 2  # of the rough solution before each step of the calibration


@dataclass(frozen=True)
class _Job:
    """A calibration by the frames before one, with its prior, and the frame from which on it is used.

    However quickly it was found, so that results repeat.
    """

    due_frame: int
    frame: int
    prior: CameraPrior
    found: "Future[RefinedCamera]"


class LiveCalibration:
    """Refinement of the calibration after a window of frames, after half as many again, and so on.

    Args:
        context: Camera as given, and settings.

    Attributes:
        camera: As refined so far.
        warnings: What the last change was.
    """

    def __init__(self, context: SmoothingContext) -> None:
        self._context, config = context, context.config
        self.camera, self._given = context.camera, context.camera
        self.warnings: tuple[str, ...] = ()
        self._due_frame = config.window.length_frames
        self._view_frames = RetentionPolicy.of(config).view_frames
        self._known = [(0, prior_about(context.camera, config.intrinsics))]  # by the frames before each
        self._job: _Job | None = None

    def update(self, local_map: LocalMap, camera: Camera, sensors: Sensors) -> None:
        """Take over a calibration that is due, and begin the next one in a thread.

        ``camera`` is that of the map, which follows the refined one with the next window.
        """
        newest, window = local_map.next_frame, self._context.config.window
        if self._job is not None and newest >= self._job.due_frame:
            self._take(self._job)
            self._job = None
        posed = local_map.moving[local_map.first_posed - local_map.first_frame :]
        enough = np.count_nonzero(posed) >= window.length_frames
        if self._job is None and newest >= self._due_frame and enough:
            self._due_frame = round(_NEXT * newest)
            whole, _, first = self._kept(local_map)
            scene, _ = without_stops(whole)
            prior = next(known for frame, known in reversed(self._known) if frame <= first)
            found = begin(self._found, scene, camera, prior, sensors)
            self._job = _Job(newest + window.every_frames, newest, prior, found)

    def _take(self, job: _Job) -> None:
        """Take over a calibration that differs from the one in use; a failed one changes nothing."""
        with suppress(GeometryError, RuntimeError, np.linalg.LinAlgError):
            refined = job.found.result()
            sigma = np.array([*refined.sigma.values(), *job.prior.sigma[len(refined.sigma) :]])
            self._known.append((job.frame, CameraPrior(refined.camera, sigma)))
            if refined.differs_from(self.camera, self._context.config.intrinsics.tolerance_sigmas):
                self.camera, self.warnings = refined.camera, (refined.note(self._given),)

    def _kept(self, local_map: LocalMap) -> tuple[Scene, IntArray, int]:
        """Return the frames whose observations are kept, the ids of their features, and the first frame."""
        first = max(local_map.first_posed, local_map.last_moving(self._view_frames))
        return *scene_of_map(local_map, first, self._context.controls), first

    def _found(self, scene: Scene, camera: Camera, prior: CameraPrior, sensors: Sensors) -> RefinedCamera:
        config = self._context.config
        step = frame_step(scene, config)
        rough = for_few_frames(config, step, _STEP_ITERATIONS)

        def optimise(
            scene: Scene, camera: Camera, every: int | None = None, sigma: FloatArray | None = None
        ) -> BatchResult:
            return self._solved(scene, camera, sensors, rough)

        return estimate_camera(scene, camera, prior, optimise, config.intrinsics, step)

    def resolved(self, local_map: LocalMap, before: Camera, sensors: Sensors) -> MapUpdate:
        """Return the map as the refined camera sees it: observations, and poses and points that fit them.

        Raises:
            GeometryError, RuntimeError, LinAlgError: The frames cannot be optimised with it.
        """
        whole, ids, first = self._kept(local_map)
        scene, rows = without_stops(whole)
        scene = seen_by(self.camera, before, scene)
        config = for_few_frames(self._context.config, 1, self._context.config.batch.iterations)
        result = self._solved(scene, self.camera, sensors, config)
        reliable = np.isfinite(result.sigma_px)
        return MapUpdate(
            undistorted=undistorted_again(self.camera, before),
            first_frame=first,
            poses=with_stops(whole, rows, result.trajectory.world_T_camera),
            positions=Positions(ids[reliable], result.points[reliable], result.sigma_px[reliable]),
        )

    def _solved(self, scene: Scene, camera: Camera, sensors: Sensors, config: Config) -> BatchResult:
        context = replace(self._context, camera=camera, config=config, imu=None, rough=True)
        return optimise_batch(scene, Fixes.empty(), sensors, context, held_frames(scene, config))
