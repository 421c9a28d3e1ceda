"""Settings of the GPS: its model, the regions of its fix classes, and what is believed of its fixes."""

from typing import Literal

from pydantic import Field, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.model import FixClass

GpsModel = Literal["none", "gaussian", "gaussian-receiver", "ellipsoid", "cylinder", "cauchy"]


class OutlierConfig(SettingsModel):
    """What is believed of fixes before the video has spoken."""

    enabled: bool = True
    """Whether fixes are judged at all; `cauchy` is robust by itself and never is."""
    outlier_share: PositiveFloat = 0.05
    """Prior probability that a fix is wrong altogether."""
    lower_share: PositiveFloat = 0.02
    """Prior probability that an RTK-fix has the error of an RTK-float."""
    tail_share: PositiveFloat = 0.05
    """Share of a class that lies outside its region by nature: what a survey drops."""
    tail_size: PositiveFloat = 2.0
    """These lie in a cylinder so many times the size."""
    outlier_radius_m: PositiveFloat = 50.0
    """A wrong fix lies anywhere within this distance."""
    lasting_share: PositiveFloat = 0.02
    """Probability that what is wrong with a fix is wrong with the next one too. It is kept low, for a camera
    that loses its scale all at once looks the same."""
    path_tolerance: PositiveFloat = 0.02
    """The path may be wrong by this share of the way between two knots of its drift."""


class Region(SettingsModel):
    """The cylinder of a fix class: radius and half height, metres; 95 % of its fixes lie within each."""

    r_m: PositiveFloat
    h_m: PositiveFloat
    correlation_s: PositiveFloat = 60.0
    """After this time the error of a fix counts as a new one; standard deviations depend on it, and the
    balance where it is estimated."""


def _default_regions() -> dict[FixClass, Region]:
    return {
        FixClass.RTK_FIX: Region(r_m=0.07, h_m=0.05, correlation_s=10.0),
        FixClass.RTK_FLOAT: Region(r_m=2.4, h_m=6.5),
        FixClass.PPP: Region(r_m=0.5, h_m=1.0),
        FixClass.DGPS: Region(r_m=3.0, h_m=6.0),
        FixClass.SBAS: Region(r_m=3.0, h_m=6.0),
        FixClass.SINGLE: Region(r_m=6.0, h_m=12.0),
    }


class QualityConfig(SettingsModel):
    """When a fix is worse than its class: its region then grows, it never shrinks."""

    enlarge: bool = True
    """Whether regions depend on more than the class."""
    good_hdop: PositiveFloat = 2.0
    """A region grows in proportion to a horizontal dilution of precision beyond this."""
    good_satellites: PositiveInt = 8
    """Where the log has no dilution: it grows with the root of what is left over of so many satellites."""
    fresh_s: PositiveFloat = 10.0
    """Corrections are good for this long."""
    age_rate_m_s: PositiveFloat = 0.002
    """So much is added for every second more: how fast a satellite's clock and the air wander."""


class SkyConfig(SettingsModel):
    """When the reconstructed scene hides the sky from the antenna: regions then grow."""

    enlarge: bool = False
    """Whether they do."""
    mask_deg: float = Field(default=15.0, ge=0.0, lt=90.0)
    """The receiver uses no satellite below this elevation: what hides only these does no harm."""
    sectors: PositiveInt = 24
    """Directions in which the horizon is told apart."""
    least_landmarks: PositiveInt = 3
    """The horizon is where so many landmarks of a sector still reach; single ones may be wrong."""
    near_m: PositiveFloat = 1.0
    """Landmarks nearer than this may be of the vehicle."""
    reach_m: PositiveFloat = 60.0
    """Landmarks further away are too uncertain, and of a skyline that is low anyway."""


class GpsConfig(SettingsModel):
    """The GPS term of the energy (11)."""

    model: GpsModel = "cylinder"
    n: PositiveInt = 2
    """Exponent of (16) and (22): the larger, the flatter inside and the steeper outside."""
    omega: PositiveFloat = 0.5
    """Weight of the GPS term: with 0.5 the penalty at the wall equals that of a one-sigma residual."""
    min_sigma_m: PositiveFloat = 0.01
    """No receiver's own sigma is believed below this."""
    gaussian_sigma_m: PositiveFloat = 1.0
    """Sigma of every fix under `gaussian`, which ignores accuracy (14)."""
    quality: QualityConfig = QualityConfig()
    sky: SkyConfig = SkyConfig()
    regions: dict[FixClass, Region] = Field(default_factory=_default_regions)
    """r(p) and h(p) per fix class, from a survey of the receiver. Classes not named are not used."""
