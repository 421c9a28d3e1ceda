"""Settings of the camera's known height above the ground."""

from typing import ClassVar

from pydantic import Field, NonNegativeFloat, PositiveFloat

from vgps.config.base import SettingsModel


class CameraHeightConfig(SettingsModel):
    """The height of the camera above the plane that it drives on: stage D takes the scale from it."""

    basic: ClassVar[tuple[str, ...]] = ("m", "sigma_m")

    m: NonNegativeFloat = Field(default=0.0, json_schema_extra={"unit": "m"})
    """Height of the camera above the ground, metres; 0 if it is not known."""
    sigma_m: PositiveFloat = 0.05
    """Its standard deviation over the recording: how well it was measured, and load and tyres."""
