"""Settings of the calibration of a camera from its own video."""

from typing import ClassVar

from pydantic import PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.config.quantities import Share


class CameraCalibrationConfig(SettingsModel):
    """A missing calibration: a guess of the lens is fitted to pairs of views, and refined in stage D."""

    basic: ClassVar[tuple[str, ...]] = ("max_frames",)

    max_frames: PositiveInt = 1500
    """Frames from the start of the video at most that are searched for pairs of views."""
    pair_flow_share: Share = 0.03
    """The median feature moves by this share of the image's diagonal from one view of a pair to the other."""
    min_pair_features: PositiveInt = 80
    """Features needed in both views of a pair."""
    max_pairs: PositiveInt = 30
    """Pairs used at most, evenly spread over those found."""
    min_pairs: PositiveInt = 3
    """With fewer pairs the guess stays as it is until stage D."""
    iterations: PositiveInt = 30
    """Steps of a fit of the lens to the pairs at most."""
    noise_px: PositiveFloat = 0.5
    """Standard deviation of a feature's distance from its epipolar line, before the pairs show it."""
    restart_share: Share = 0.005
    """Stages A to C run again with the camera that D found if its rays differ by more than this share;
    then twice more at most, by 5 %."""
