"""Settings of a rolling shutter."""

from typing import ClassVar, Literal

from pydantic import PositiveFloat

from vgps.config.base import SettingsModel


class RollingShutterConfig(SettingsModel):
    """The readout of a camera that exposes row after row, ``readout_s`` of its calibration."""

    basic: ClassVar[tuple[str, ...]] = ("estimate",)

    estimate: Literal["auto", "yes", "no"] = "auto"
    """Estimate the readout with the poses: auto where the calibration does not give it, and only if it cannot
    be chance; yes always; no never, and an unknown shutter then counts as global."""
    min_sigmas: PositiveFloat = 5.0
    """An estimate of auto counts if it differs from zero by so many standard deviations."""
