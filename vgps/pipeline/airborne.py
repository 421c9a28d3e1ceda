"""Whether a recording's camera flies."""

from vgps.config import Config
from vgps.model import Recording


def with_airborne(recording: Recording, config: Config) -> Config:
    """Return the settings: ``start.airborne: auto`` is ``yes`` where the fixes are those of a drone."""
    start = config.start
    if start.airborne != "auto" or recording.gps is None or not recording.gps.airborne:
        return config
    return config.model_copy(update={"start": start.model_copy(update={"airborne": "yes"})})
