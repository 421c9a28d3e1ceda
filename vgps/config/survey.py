"""Settings of the survey of a receiver."""

from typing import ClassVar

from pydantic import Field, NonNegativeFloat, PositiveFloat

from vgps.config.base import SettingsModel


class SurveyConfig(SettingsModel):
    """How the region of a fix class and the changes of its errors follow from logs of a receiver."""

    basic: ClassVar[tuple[str, ...]] = ("drop",)

    drop: float = Field(default=0.05, ge=0.0, lt=1.0)
    """Share of the worst epochs that a region leaves out, horizontally and vertically each."""
    speed_m_s: NonNegativeFloat = 0.0
    """Horizontal speed of later recordings; r grows by half a frame interval of this motion."""
    vertical_speed_m_s: NonNegativeFloat = 0.0
    """Vertical speed of later recordings; h grows likewise."""
    frame_rate: PositiveFloat = Field(default=30.0, json_schema_extra={"unit": "Hz"})
    """Frame rate of later recordings."""
    max_gap_s: PositiveFloat = 10.0
    """A stretch of one fix class ends at a longer gap; the error changes afresh after it."""
    min_independent_epochs: PositiveFloat = 20.0
    """A warning is given if a class's epochs are worth fewer independent ones, or fewer follow each other."""
    max_spread_m: PositiveFloat = 1.0
    """The receiver counts as moving if half of its RTK-fix epochs lie further than this from their mean; a
    reference as another antenna's if half of the RTK-fixes of both differ by more."""
