"""What is believed of the time offset while the video runs, and what that means for the poses.

A fit holds the time offset at what was believed before, and its normal equations tell what the fixes prefer.
Two hypotheses are weighed by that (:func:`vgps.gps.time_offset.model_average`): clocks that agree, and any
time offset. The video's scale drifts in spells, which look like a time offset while a vehicle speeds up; so
what the fixes prefer counts with ``significance_sigmas`` times its standard deviation, and no better than
clocks agree. Fixes are shifted once an offset is likelier than none. The uncertainty of the time offset is
added to that of the poses (Schmidt's considered parameter: Jazwinski, Stochastic Processes and Filtering
Theory, 1970, section 8.4).
"""

from dataclasses import dataclass

import numpy as np

from vgps.config import Config, SensorsConfig
from vgps.gps.sensors import TimeOffset
from vgps.gps.time_offset import model_average, without_prior
from vgps.model import FloatArray

HELD_S = 1e-4  # standard deviation with which a fit holds the time offset
_HALF_STEP_S = 0.25  # of a walk, over which its bob evens out
_AGREE_S = 1e-6  # of clocks that agree: ``trusted_time_offset_s`` is in what the fixes prefer


@dataclass(frozen=True)
class LiveTimeOffset(TimeOffset):
    """What is believed of the rest of the time offset.

    Attributes:
        reach_s: How far about it velocities are means: a standard deviation, and half a step of a walk unless
            the time offset is known better than that even if clocks do not agree. Else the bob would tell it
            to a fraction of its period as soon as agreement is likelier.
    """

    reach_s: float


def video_alone(config: Config) -> Config:
    """Return the settings of a stage C that leaves fixes and their time offset to the fusion.

    No feature comes back: one that does so again and again would keep its map from forgetting.
    """
    sensors = config.sensors.model_copy(update={"estimate_time_offset": "no"})
    tracking = config.tracking.model_copy(update={"return_frames": 0})
    return config.with_gps(model="none").model_copy(update={"sensors": sensors, "tracking": tracking})


def any_time_offset(config: SensorsConfig) -> TimeOffset:
    """Return the prior of the rest of the time offset where clocks do not agree."""
    return TimeOffset(0.0, config.time_offset_sigma_s)


def unseen_time_offset(config: SensorsConfig) -> LiveTimeOffset:
    """Return what is believed of the rest of the time offset before any fix."""
    return believed_time_offset(any_time_offset(config), config)


def believed_time_offset(found: TimeOffset, config: SensorsConfig) -> LiveTimeOffset:
    """Return the rest of the time offset with its standard deviation and reach.

    Args:
        found: What the fixes prefer, under :func:`any_time_offset`.
        config: Both hypotheses.
    """
    if config.estimate_time_offset == "no":
        return LiveTimeOffset(0.0, 0.0, 0.0)
    prior = any_time_offset(config)
    said = without_prior(found, prior)
    sigma_s = float(np.hypot(config.significance_sigmas * said.sigma_s, config.trusted_time_offset_s))
    said = TimeOffset(said.time_offset_s, sigma_s)
    wrong, _ = model_average(said, prior, prior.sigma_s)
    agree_s = _AGREE_S if config.estimate_time_offset == "auto" else prior.sigma_s
    likely, probability = model_average(said, prior, agree_s)
    if config.estimate_time_offset == "auto" and probability < 0.5:  # fixes are shifted by what is likely
        likely = TimeOffset(0.0, float(np.hypot(likely.sigma_s, likely.time_offset_s)))
    open_s = float(np.hypot(wrong.sigma_s, wrong.time_offset_s - likely.time_offset_s))
    reach_s = max(likely.sigma_s, min(open_s, _HALF_STEP_S))
    return LiveTimeOffset(likely.time_offset_s, likely.sigma_s, reach_s)


def with_time_offset_sigma(covariance: FloatArray, row: int, sigma_s: float) -> FloatArray:
    """Return covariances (..., n, n) in which the time offset, in one row, has another standard deviation."""
    gain = covariance[..., :, row] / covariance[..., row, row, None]
    added = sigma_s**2 - covariance[..., row, row, None, None]
    return np.asarray(covariance + added * gain[..., :, None] * gain[..., None, :])
