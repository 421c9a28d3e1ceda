"""What the tracker found, as a Solution, so that every verb that takes a run takes it too."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from vgps.config import Config
from vgps.geometry import world_sigmas
from vgps.localization.tracker import TrackedFrame
from vgps.model import FloatArray, GeodeticPoint, Recording
from vgps.solution import FrameState, Landmarks, Observations, SensorReport, Solution, SolverReport


def to_solution(
    recording: Recording,
    world_origin: GeodeticPoint | None,
    config: Config,
    frames: Sequence[TrackedFrame],
    world_T_camera: FloatArray,
    gray: Sequence[FloatArray],
    seconds: Mapping[str, float],
    warnings: Sequence[str],
) -> Solution:
    """A Solution in the database's world.

    Args:
        recording: What was localized.
        world_origin: Of the database.
        config: As used.
        frames: One per frame of the video.
        world_T_camera: (F, 4, 4) final poses.
        gray: Of each frame the luminance (N,) at its observations.
        seconds: Per stage.
        warnings: What to know.
    """
    landmarks, observations = _seen(frames, gray)
    covariance = np.array([frame.covariance for frame in frames])
    rotation, position = world_sigmas(np.array([frame.world_T_camera for frame in frames]), covariance)
    return Solution(
        recording=recording.path,
        world_origin=world_origin,
        georeferenced=True,
        t_s=np.array([frame.t_s for frame in frames]),
        world_T_camera=world_T_camera,
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
        report=SolverReport(
            {}, {}, 0, f"tracked against landmarks, estimator {config.localization.estimator}"
        ),
        seconds=seconds,
        warnings=tuple(warnings),
        config=config.model_dump(mode="json"),
        video_start_utc=recording.rig.video_start_utc,
    )


def _seen(frames: Sequence[TrackedFrame], gray: Sequence[FloatArray]) -> tuple[Landmarks, Observations]:
    """The landmarks that were seen at all, and where."""
    seen = [frame.observations for frame in frames]
    ids = np.concatenate([part.landmark for part in seen])
    _, first, row = np.unique(ids, return_index=True, return_inverse=True)
    landmarks = Landmarks(
        np.concatenate([part.world_p_landmark for part in seen])[first],
        np.concatenate([part.sigma_px for part in seen])[first],
        np.clip(np.concatenate(gray)[first], 0, 255).astype(np.uint8),
    )
    frame = np.repeat(np.arange(len(seen)), [len(part) for part in seen])
    return landmarks, Observations(frame, row.ravel(), np.concatenate([part.uv_px for part in seen]))
