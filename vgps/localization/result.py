"""Results of localization as a Solution, which every verb that takes a run accepts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.geometry import world_sigmas
from vgps.localization.tracker import TrackedFrame
from vgps.model import FloatArray, GeodeticPoint, Recording
from vgps.solution import FrameState, Landmarks, Observations, SensorReport, Solution, SolverReport


@dataclass(frozen=True, kw_only=True)
class Track:
    """Every frame of a video, tracked.

    Attributes:
        frames: One per frame of the video.
        gray: Per frame, luminance (N,) at its observations.
        world_T_camera: (F, 4, 4) final poses.
        seconds: Per stage.
        warnings: For the user.
    """

    frames: Sequence[TrackedFrame]
    gray: Sequence[FloatArray]
    world_T_camera: FloatArray
    seconds: Mapping[str, float]
    warnings: Sequence[str]


def to_solution(
    recording: Recording, world_origin: GeodeticPoint | None, config: Config, track: Track
) -> Solution:
    """Return a Solution in the database's world.

    Args:
        recording: The recording that was localised.
        world_origin: Of the database.
        config: As used.
        track: The result.
    """
    frames = track.frames
    landmarks, observations = _landmarks(track)
    covariance = np.array([frame.covariance for frame in frames])
    rotation, position = world_sigmas(np.array([frame.world_T_camera for frame in frames]), covariance)
    estimator = config.localization.estimator
    return Solution(
        recording=recording.path,
        world_origin=world_origin,
        georeferenced=True,
        t_s=np.array([frame.t_s for frame in frames]),
        world_T_camera=track.world_T_camera,
        sigma_rotation_rad=rotation,
        sigma_position_m=position,
        state=tuple(FrameState.TRACKED if frame.tracked else FrameState.BRIDGED for frame in frames),
        camera=recording.camera,
        camera_p_antenna=recording.rig.camera_p_antenna,
        landmarks=landmarks,
        observations=observations,
        gps=None,
        fixes=None,
        sensors=SensorReport(0.0, math.nan, (math.nan, math.nan, math.nan)),
        report=SolverReport({}, {}, 0, f"tracked against landmarks, estimator {estimator}"),
        seconds=track.seconds,
        warnings=tuple(track.warnings),
        config=config.model_dump(mode="json"),
        video_start_utc=recording.rig.video_start_utc,
    )


def _landmarks(track: Track) -> tuple[Landmarks, Observations]:
    """Return the landmarks observed in any frame, and their observations."""
    matches = [frame.observations for frame in track.frames]
    ids = np.concatenate([part.landmark for part in matches])
    _, first, row = np.unique(ids, return_index=True, return_inverse=True)
    landmarks = Landmarks(
        np.concatenate([part.world_p_landmark for part in matches])[first],
        np.concatenate([part.sigma_px for part in matches])[first],
        np.clip(np.concatenate(track.gray)[first], 0, 255).astype(np.uint8),
    )
    frame = np.repeat(np.arange(len(matches)), [len(part) for part in matches])
    return landmarks, Observations(frame, row.ravel(), np.concatenate([part.seen_px for part in matches]))
