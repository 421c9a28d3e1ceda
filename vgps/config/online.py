"""Settings of the smoother that is fed live."""

from typing import ClassVar

from pydantic import PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel


class OnlineConfig(SettingsModel):
    """Memory, gaps and smooth poses of a sequence that is fed live."""

    basic: ClassVar[tuple[str, ...]] = ("keep_s",)

    keep_s: PositiveFloat = 120.0
    """Path and fixes are kept for this long, to judge late fixes and to correct drift when GPS returns."""
    repeatable: bool = True
    """Poses wait for a fit that is late on busy cores, so that a recording gives the same poses again. With a
    live camera they never do: a fit counts once it is found."""
    places: PositiveInt = 1000
    """Places remembered, the newest; each takes about 40 kB. One that is seen again corrects the pose."""
    bridge_s: PositiveFloat = 1.0
    """Frames without features go on at constant velocity for this long; then the camera is lost."""
    bridge_sigma_m: PositiveFloat = 1.0
    """With an IMU they go on by it until the standard deviation of their position has grown by this."""
    correction_m: PositiveFloat = 0.5
    """A correction that moves the newest pose by at least this is reported as an event."""
    blend_s: PositiveFloat = 2.0
    """Time constant with which the smooth pose approaches the corrected one."""
    blend_m_s: PositiveFloat = 1.0
    """Largest speed at which it does."""
    blend_deg_s: PositiveFloat = 5.0
    """Largest rate of rotation at which it does."""
