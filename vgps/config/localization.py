"""Settings of the tracker against a landmark database."""

from typing import Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.config.landmarks import SelectionConfig


class LocalizationConfig(SettingsModel):
    """The tracker of Matsuda 2007, (A) to (E), and its variants."""

    estimator: Literal["frame", "graph"] = "graph"
    """(E) from the matches of one frame, or a factor graph over the last ones with gyro and motion."""
    use_gyro: bool = True
    """(A) rotation from the gyro; otherwise constant angular velocity."""
    select: Literal["prediction", "last_pose"] = "prediction"
    """(B) landmarks chosen, warped and searched by the predicted pose, or by the last one."""
    blur: Literal["exposure", "interval", "none"] = "exposure"
    """(C) image motion over the exposure itself, or over the interval since the last frame scaled to the
    exposure as in the paper, or templates left sharp."""
    window: Literal["depth", "fixed"] = "depth"
    """(D) window by depth, Eq. (6), or one size for all."""

    selection: SelectionConfig = SelectionConfig()
    max_landmarks: PositiveInt = Field(default=120, le=2000)
    """Landmarks looked for in a frame."""
    first_landmarks: PositiveInt = Field(default=40, le=2000)
    """Landmarks looked for around the prediction; all are, in small windows, around the pose these give."""
    template_px: PositiveInt = Field(default=15, le=101)
    """Side of a template in the image, odd."""
    max_blur_px: PositiveFloat = Field(default=150.0, le=300.0)
    """Longer image motions are cut to this."""
    min_correlation: PositiveFloat = 0.6
    """A match below this normalised cross-correlation is none."""
    min_contrast: PositiveFloat = 3.0
    """Templates whose grey values, once blurred, have less standard deviation than this are not matched."""
    max_speed_m_s: PositiveFloat = 15.0
    """V_max of Eq. (6) while the velocity is not known, which is in the frame after a start."""
    speed_error_m_s: PositiveFloat = 1.5
    """V_max of Eq. (6) beyond the constant velocity."""
    rotation_error_px: PositiveFloat = 4.0
    """delta' of Eq. (6) with a gyro."""
    no_gyro_error_px: PositiveFloat = 24.0
    """delta' of Eq. (6) without one: the turn rate may change by so much within a frame."""
    fixed_window_px: PositiveInt = 12
    """Half side of the window where it is one for all."""
    max_window_px: PositiveInt = 48
    widen: PositiveFloat = 2.5
    """After a failure the same frame is searched again with windows so much larger."""
    refine_window_px: PositiveInt = 3
    """Half side of the second search, around the first pose; it finds what the first missed."""

    recovery_pause_s: NonNegativeFloat = 0.25
    """So long after a vain try by descriptors the next one waits: it costs as much as several frames."""
    recovery_features: PositiveInt = 1500
    """Features of a frame that are compared with those of the keyframes."""
    recovery_candidates: PositiveInt = 3
    """Poses from descriptors that are searched around."""
    recovery_window_px: PositiveInt = 16
    """Half side of the windows around a pose from descriptors."""

    ransac_px: PositiveFloat = 3.0
    """A match agrees with a pose if it is this near."""
    ransac_samples: PositiveInt = 200
    min_inliers: PositiveInt = 6
    """Fewer than this and the frame is a failure, Matsuda 2007."""
    min_inlier_share: PositiveFloat = 0.25
    """A smaller share of the matches and the frame is a failure: chance gives as much."""
    match_sigma_px: PositiveFloat = 0.5
    """Standard deviation of a match, added to the landmark's own reliability."""
    huber_px: PositiveFloat = 1.5
    """Errors beyond this grow linearly."""
    max_turn_error_deg: PositiveFloat = 6.0
    """A pose that differs from the prediction by more is a failure."""
    coast_s: PositiveFloat = 3.0
    """So long after the last good frame a prediction is still searched around."""

    recovery_ratio: PositiveFloat = 0.85
    """Lowe's test between the best and the second best descriptor."""
    recovery_keyframes: PositiveInt = 12
    """Keyframes with most matches that are tried when the pose is not known at all."""

    revise: bool = True
    """A pose in the result is the one with what was seen in the lag after it; otherwise as it came."""
    lag_s: PositiveFloat = 1.0
    """Frames of so long a time are in the graph."""
    gyro_density_rad_s0p5: PositiveFloat = 0.0005
    """White noise of the gyro, rad/s/sqrt(Hz)."""
    bias_sigma_rad_s: PositiveFloat = 0.02
    """Standard deviation of the gyro's bias before anything was seen."""
    bias_walk_rad_s1p5: PositiveFloat = 1e-4
    """Random walk of the gyro's bias, rad/s^2/sqrt(Hz)."""
    acceleration_density_m_s1p5: PositiveFloat = 1.5
    """White noise on the acceleration of the camera's centre, m/s^2/sqrt(Hz)."""
