"""A rolling shutter that the first frames show, before all others are followed as of a global one."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.model import Recording
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.readout_estimation import readout_of
from vgps.pipeline.rough_solution import optimise_roughly
from vgps.pipeline.solved_maps import merged_maps
from vgps.smoothing.calibration.readout import Readout
from vgps.solution import Solution

_FRAMES = (60, 120, 240)  # numbers of frames after which to look


class ReadoutProbe:
    """Looks for a rolling shutter in what the first frames gave, and stops there if it cannot be chance.

    A rough solution of stage D and a step in the readout cost little beside following a whole video twice;
    stage D takes further steps. Where the first frames do not show it, stage D looks for it in all of them.

    Args:
        recording: Its readout is unknown.
        config: Settings.

    Attributes:
        found: The readout that was seen; None so far.
    """

    def __init__(self, recording: Recording, config: Config) -> None:
        guesses = recording.guesses
        self._config, self._looking = config, True
        self._camera_sigma = guesses[0].sigmas[:4] if guesses else config.intrinsics.held_sigmas
        self.found: Readout | None = None

    def stops(self, frames: int, so_far: Callable[[], FrontEnd]) -> bool:
        """Return whether a rolling shutter is seen after some number of frames.

        Args:
            frames: Number of frames so far.
            so_far: Gives what they show.
        """
        if frames not in _FRAMES or not self._looking:
            return False
        try:
            seen = self._estimate(so_far())
        except GeometryError:  # too little was seen yet
            return False
        sigmas = self._config.rolling_shutter.min_sigmas
        self.found = seen if seen.is_shown(sigmas) else None
        self._looking = not seen.would_show(sigmas)
        return self.found is not None

    def _estimate(self, front_end: FrontEnd) -> Readout:
        if not front_end.maps:
            raise GeometryError("no map has started yet")
        camera = front_end.recording.camera
        merged = merged_maps(front_end, front_end.context(self._config))
        batch = optimise_roughly(front_end, merged, camera, self._config)
        return readout_of(batch, camera, self._camera_sigma)


def readout_probe(recording: Recording, config: Config) -> ReadoutProbe | None:
    """Return a probe if the readout is to be estimated and nothing is known of it."""
    unknown = config.rolling_shutter.estimate == "auto" and recording.camera.readout_s is None
    return ReadoutProbe(recording, config) if unknown and not recording.cameras else None


def with_readout_seen(recording: Recording, config: Config, readout_s: float) -> tuple[Recording, Config]:
    """Return the recording with a readout, and settings by which stage D improves it."""
    rolling = config.rolling_shutter.model_copy(update={"estimate": "yes"})
    camera = replace(recording.camera, readout_s=readout_s)
    return replace(recording, camera=camera), config.model_copy(update={"rolling_shutter": rolling})


def is_confirmed(solution: Solution, config: Config) -> bool:
    """Return whether the readout that all frames show is no chance either."""
    readout_s, sigma_s = solution.camera.readout_s, solution.sensors.camera_sigma.get("readout_s")
    if readout_s is None or sigma_s is None:
        return False
    frame_s = float(np.median(np.diff(solution.t_s)))
    return Readout(readout_s, sigma_s, frame_s).is_shown(config.rolling_shutter.min_sigmas)
