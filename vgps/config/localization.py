"""Settings of the tracker against a landmark database."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.config.landmarks import SelectionConfig
from vgps.config.quantities import Fraction, Share


class LocalizationConfig(SettingsModel):
    """The tracker of Matsuda 2007, (A) to (E), and its variants."""

    renamed: ClassVar[Mapping[str, str]] = {
        "max_turn_error_deg": "max_rotation_error_deg",
        "widen": "retry_widening",
    }
    basic: ClassVar[tuple[str, ...]] = ("estimator", "use_gyro", "blur", "max_landmarks", "max_speed_m_s")

    estimator: Literal["frame", "graph"] = "graph"
    """(E) Pose from the matches of one frame, or from a factor graph over the last frames with gyro and
    motion."""
    use_gyro: bool = True
    """(A) Predict the rotation by the gyro; otherwise at constant angular velocity."""
    select: Literal["prediction", "last_pose"] = "prediction"
    """(B) Pose by which landmarks are chosen, warped and searched: the predicted one or the last one."""
    blur: Literal["exposure", "interval", "none"] = "exposure"
    """(C) Blur templates by the motion over the exposure, over the last interval as in the paper, or not."""
    window: Literal["depth", "fixed"] = "depth"
    """(D) Search window by depth, Eq. (6), or one size for all."""

    selection: SelectionConfig = SelectionConfig()
    max_landmarks: PositiveInt = Field(default=120, le=2000)
    """Landmarks searched in a frame at most."""
    first_landmarks: PositiveInt = Field(default=40, le=2000)
    """Landmarks searched around the prediction; all others then around the pose that these give."""
    template_px: PositiveInt = Field(default=15, le=101)
    """Side of a template in the image, odd."""
    max_blur_px: PositiveFloat = Field(default=150.0, le=300.0)
    """Upper bound of the image motion by which templates are blurred."""
    min_correlation: Fraction = 0.6
    """A match is rejected if its normalised cross-correlation is lower."""
    min_contrast: PositiveFloat = 3.0
    """Blurred templates with a smaller standard deviation of grey values (0 to 255) are not searched."""
    max_speed_m_s: PositiveFloat = 15.0
    """V_max of Eq. (6) where the velocity is unknown, that is in the frame after a start."""
    speed_error_m_s: PositiveFloat = 1.5
    """V_max of Eq. (6) where the velocity is known: the error of its prediction."""
    rotation_error_px: PositiveFloat = 4.0
    """delta' of Eq. (6) with a gyro: image motion by errors of the predicted rotation."""
    no_gyro_error_px: PositiveFloat = 24.0
    """delta' of Eq. (6) without a gyro: image motion by the change of angular velocity within a frame."""
    fixed_window_px: PositiveInt = 12
    """Half the side of the search window if window is fixed."""
    max_window_px: PositiveInt = 48
    """Upper bound of half the side of a search window; the last attempt at unknown velocity goes beyond."""
    retry_widening: float = Field(default=2.5, ge=1.0)
    """Factor on the windows and on the limits of a pose when a frame that failed is searched again."""
    refine_window_px: PositiveInt = 3
    """Half the side of the windows of the second search, around the pose that the first one gave."""

    recovery_pause_s: NonNegativeFloat = 0.25
    """Pause between two failed recoveries by descriptors, each of which costs as much as several frames."""
    recovery_features: PositiveInt = 1500
    """Features of a frame that are compared with the keyframes' at most."""
    recovery_ratio: Fraction = 0.85
    """Lowe's ratio: a match is kept if its distance is below this times that of the second best landmark."""
    recovery_keyframes: PositiveInt = 12
    """Keyframes tried at most, those with most matches first."""
    recovery_candidates: PositiveInt = 3
    """Poses from descriptors around which landmarks are searched at most."""
    recovery_window_px: PositiveInt = 16
    """Half the side of the search windows around a pose from descriptors."""

    ransac_px: PositiveFloat = 3.0
    """A match is an inlier of a pose if its reprojection error is smaller; twice this for descriptors."""
    ransac_samples: PositiveInt = 200
    """Minimal samples drawn for a pose at most."""
    ransac_confidence: Share = 0.9999
    """Sampling stops once a sample without outliers was drawn with this probability."""
    skip_ransac_share: Share = 0.7
    """Nothing is sampled if at least this share of the matches agrees with the pose searched around."""
    min_inliers: PositiveInt = 6
    """A frame with fewer inliers has failed (Matsuda 2007)."""
    min_inlier_share: Share = 0.25
    """A frame with a smaller share of inliers among its matches has failed: chance gives as many."""
    match_sigma_px: PositiveFloat = 0.5
    """Standard deviation of a match, to which that of the landmark's own position is added."""
    huber_px: PositiveFloat = 1.5
    """Huber's constant: reprojection errors beyond it count linearly."""
    max_rotation_error_deg: PositiveFloat = Field(default=6.0, le=180.0)
    """A pose that is rotated by more than this against the prediction is rejected."""
    max_velocity_gap_s: PositiveFloat = 0.5
    """Two tracked frames further apart than this give no velocity."""
    coast_s: PositiveFloat = 3.0
    """Predictions are searched around for this long after the last tracked frame; then recovery begins."""

    revise: bool = True
    """Write each pose as revised by the frames of the next lag_s; otherwise as it came."""
    lag_s: PositiveFloat = 1.0
    """Time span of the frames in the graph."""
    min_graph_agreement: Share = 0.5
    """The graph starts anew if fewer of a frame's inliers than this share agree with its pose."""
    gyro_density_rad_s0p5: PositiveFloat = Field(default=0.0005, json_schema_extra={"unit": "rad/s/sqrt(Hz)"})
    """White noise of the gyro's rates."""
    bias_sigma_rad_s: PositiveFloat = 0.02
    """Prior standard deviation of the gyro's bias, on each axis."""
    bias_walk_rad_s1p5: PositiveFloat = Field(default=1e-4, json_schema_extra={"unit": "rad/s^2/sqrt(Hz)"})
    """Random walk of the gyro's bias."""
    acceleration_density_m_s1p5: PositiveFloat = Field(
        default=1.5, json_schema_extra={"unit": "m/s^2/sqrt(Hz)"}
    )
    """White noise of the acceleration of the camera's centre."""
