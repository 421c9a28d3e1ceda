"""Settings of GPS: its model, the regions of the fix classes, and the detection of outliers."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from vgps.config.base import SettingsModel
from vgps.config.quantities import Share
from vgps.model import FixClass

ErrorModel = Literal["memory", "independent"]
GpsModel = Literal["none", "gaussian", "gaussian-receiver", "ellipsoid", "cylinder", "cauchy"]


class OutlierConfig(SettingsModel):
    """Priors of the hidden Markov model that judges fixes against the path of the video."""

    renamed: ClassVar[Mapping[str, str]] = {"lasting_share": "persistence"}
    basic: ClassVar[tuple[str, ...]] = ("enabled",)

    enabled: bool = True
    """Judge fixes and reject outliers; the model cauchy is robust by itself and never does."""
    outlier_share: Share = 0.05
    """Prior probability that a fix is an outlier."""
    lower_share: Share = 0.02
    """Prior probability that an RTK-fix has the error of an RTK-float (a wrong integer ambiguity)."""
    tail_share: Share = 0.05
    """Share of a class's fixes outside its region by nature: what a survey drops."""
    tail_size: float = Field(default=2.0, ge=1.0)
    """Size of the cylinder that holds this tail, as a multiple of the region."""
    outlier_radius_m: PositiveFloat = 50.0
    """An outlier lies anywhere within this distance of the antenna."""
    persistence: Share = 0.02
    """Probability that an error lasts for a second, or to the next fix if that is later; kept low, since a
    sudden loss of scale looks the same."""
    max_jumps: PositiveInt = 8
    """Jumps against the path, the largest ones of each stretch (60 knots of its drift), between which runs of
    fixes are tested as outliers together."""
    path_tolerance: Share = 0.02
    """Error of the video's path between two knots of its drift, as a share of the distance between them."""

    @model_validator(mode="after")
    def _leave_room_for_good_fixes(self) -> Self:
        if self.outlier_share + self.lower_share >= 1.0:
            raise ValueError("outlier_share and lower_share together are not below 1")
        return self


class Region(SettingsModel):
    """The region of a fix class: a cylinder that holds 95 % of its fixes in the plane and 95 % in height."""

    r_m: PositiveFloat
    """Radius r(p)."""
    h_m: PositiveFloat
    """Half height h(p)."""
    alpha_m: PositiveFloat | None = None
    """Horizontal semi-axis of the model ellipsoid (22); by default r."""
    beta_m: PositiveFloat | None = None
    """Vertical semi-axis of the model ellipsoid (22); by default h."""
    correlation_s: PositiveFloat = 60.0
    """Time after which the error of a fix counts as a new one."""

    @property
    def ellipsoid_shape(self) -> tuple[float, float]:
        """Semi-axes alpha and beta of the ellipsoid over r and h of the cylinder."""
        return (self.alpha_m or self.r_m) / self.r_m, (self.beta_m or self.h_m) / self.h_m


def _default_regions() -> dict[FixClass, Region]:
    return {
        FixClass.RTK_FIX: Region(r_m=0.07, h_m=0.05, correlation_s=10.0),
        FixClass.RTK_FLOAT: Region(r_m=2.4, h_m=6.5),
        FixClass.PPP: Region(r_m=0.5, h_m=1.0),
        FixClass.DGPS: Region(r_m=3.0, h_m=6.0),
        FixClass.SBAS: Region(r_m=3.0, h_m=6.0),
        FixClass.SINGLE: Region(r_m=6.0, h_m=12.0),
    }


_DEFAULT_REGIONS = _default_regions()


class OffsetErrors(SettingsModel):
    """Errors of a fix class with memory: the region of its offsets, their walk, and the noise about them."""

    r_m: PositiveFloat = 6.0
    """Radius that holds 95 % of the offsets."""
    h_m: PositiveFloat = 12.0
    """Half height that holds 95 % of the offsets."""
    between_receivers: PositiveFloat = 0.9
    """Standard deviation of the log of this size between receivers."""
    noise_m: PositiveFloat = 0.02
    """Scale of the noise about the offset, on each horizontal axis."""
    noise_spread: NonNegativeFloat = 1.1
    """Standard deviation of the log of the noise between receivers."""
    walk_m: PositiveFloat = 0.07
    """Scale of the offset's steps over one second, on each horizontal axis."""
    walk_spread: NonNegativeFloat = 1.1
    """Standard deviation of the log of the walk between receivers."""
    rate_lasts_s: PositiveFloat = 2.0
    """Time for which the error keeps the rate of its change; over longer times it walks at random."""
    rate_spread: NonNegativeFloat = 1.1
    """Standard deviation of the log of this time between receivers; with 0 it is not learned."""
    tail: PositiveFloat = 3.0
    """Degrees of freedom of Student's t, the distribution of noise and steps; small means frequent jumps."""
    vertical: PositiveFloat = 2.2
    """Vertical noise and steps over horizontal ones."""


def _default_offsets() -> dict[FixClass, OffsetErrors]:
    # The median change of an RTK-float's error grows like t^0.7 and t^0.9 from 1 to 8 s (rtk_drive, survey),
    # that of a Septentrio's RTK-float and DGPS errors like t^0.6 within a second; a random walk like t^0.5.
    # How long the rate of an RTK-float lasts was chosen with live poses on kitti03 and kitti07: no proof for
    # other receivers. That of DGPS and single fixes is 2 s, give or take a factor of three: 1.0 s by the
    # growth of the Septentrio's DGPS errors from 1 to 3 s, 3.4 s by that of the u-blox's from 1 to 10 s
    # (medians of the axes; without north of the u-blox, where its clock shows).
    fixed = {
        "noise_m": 0.004,
        "noise_spread": 0.7,
        "walk_m": 0.002,
        "walk_spread": 0.6,
        "rate_lasts_s": 1.0,
        "rate_spread": 0.0,
    }
    floating = {
        "noise_m": 0.0025,
        "noise_spread": 1.5,
        "walk_m": 0.006,
        "walk_spread": 2.2,
        "rate_lasts_s": 20.0,
        "rate_spread": 0.0,
        "tail": 1.1,
    }
    return {
        FixClass.RTK_FIX: OffsetErrors(r_m=0.025, h_m=0.045, between_receivers=0.3, **fixed),
        FixClass.RTK_FLOAT: OffsetErrors(r_m=1.0, h_m=2.2, **floating),
        FixClass.PPP: OffsetErrors(r_m=0.5, h_m=1.0, **floating),
        FixClass.DGPS: OffsetErrors(r_m=1.5, h_m=3.0),
        FixClass.SBAS: OffsetErrors(r_m=1.5, h_m=3.0),
        FixClass.SINGLE: OffsetErrors(r_m=3.0, h_m=6.0),
    }


class MemoryConfig(SettingsModel):
    """Errors with memory: a fix is antenna + offset + noise; the offset walks, and starts anew."""

    n: PositiveInt = 1
    """Exponent of the bound of an offset; the size of a region is too unsure for a steep wall."""
    interval_s: PositiveFloat = 0.3
    """One offset stands for the fixes of this interval; one fix each where they are further apart."""
    max_gap_s: PositiveFloat = 10.0
    """After a longer gap between fixes the offset starts anew, as it does when the class changes."""
    persistence: Share = 0.9
    """Probability that the offset of a good fix lasts to the next one of its stretch, as verdicts see it."""
    stated_jump: float = Field(default=2.0, gt=1.0)
    """It also starts anew where the receiver's own sigma changes by more than this factor."""
    stated_factor: PositiveFloat = 1.5
    """Typical error of a fix over the sigma that its receiver states."""
    stated_spread: PositiveFloat = 1.85
    """Standard deviation of the log of that factor between receivers: stated sigmas are weighed, not
    believed."""
    learn: bool = True
    """Learn noise, walk and rate of each class but RTK-fix from the recording, with the classes as priors;
    live, noise and walk of classes whose errors do not drift steadily for long."""
    path_share: PositiveFloat = 0.003
    """Error of the video's path from one fix to the next, as a share of the distance; and drift of its scale
    and heading, as a share and in radians, where errors of fixes are learned along it."""
    path_spread: PositiveFloat = 0.7
    """Standard deviation of the log of this share between recordings."""
    own_spread: PositiveFloat = 0.3
    """Standard deviation of the log of a region that is not the default one, and of a noise or walk that a
    survey of this receiver gives."""
    classes: dict[FixClass, OffsetErrors] = Field(default_factory=_default_offsets)
    """Errors of each class over several receivers; of other classes the region alone counts."""


class QualityConfig(SettingsModel):
    """When a fix is worse than its class; its region then grows and never shrinks."""

    enlarge: bool = True
    """Enlarge regions by dilution of precision, satellites, age of corrections and the receiver's sigmas."""
    good_hdop: PositiveFloat = 2.0
    """A region grows in proportion to the horizontal dilution of precision beyond this."""
    good_satellites: PositiveInt = 8
    """Without a dilution in the log, a region grows if fewer satellites than this were used."""
    fresh_s: PositiveFloat = 10.0
    """Age up to which corrections lose nothing."""
    age_rate_m_s: PositiveFloat = 0.002
    """Growth of a region per second of age beyond that: the drift of satellite clocks and atmosphere."""


class SkyConfig(SettingsModel):
    """When the reconstructed scene hides the sky from the antenna; regions then grow."""

    renamed: ClassVar[Mapping[str, str]] = {
        "least_landmarks": "min_landmarks",
        "near_m": "min_distance_m",
        "reach_m": "max_distance_m",
    }

    enlarge: bool = False
    """Enlarge regions by the share of the sky that the scene hides."""
    mask_deg: float = Field(default=15.0, ge=0.0, lt=90.0)
    """Elevation mask of the receiver: what hides only the sky below it does no harm."""
    sectors: PositiveInt = 24
    """Sectors of azimuth, each with a horizon of its own."""
    min_landmarks: PositiveInt = 3
    """The horizon of a sector is the elevation that this many of its landmarks reach; fewer may be wrong."""
    min_distance_m: PositiveFloat = 1.0
    """Nearer landmarks are ignored: they may belong to the vehicle."""
    max_distance_m: PositiveFloat = 60.0
    """Landmarks further away are ignored: they are uncertain, and low above the horizon."""


class GpsConfig(SettingsModel):
    """The GPS term of the energy (11)."""

    basic: ClassVar[tuple[str, ...]] = ("model", "error_model", "n", "omega", "regions")

    model: GpsModel = "cylinder"
    """Penalty of a fix: none, gaussian (14), gaussian-receiver (15), ellipsoid (22), cylinder (16) or
    cauchy."""
    n: PositiveInt = 2
    """Exponent of (16) and (22): the larger, the flatter inside the region and the steeper outside."""
    error_model: ErrorModel = "memory"
    """Errors under cylinder and ellipsoid in stage D: lasting offsets plus noise, or independent."""
    omega: PositiveFloat = 0.5
    """Weight of the GPS term; with 0.5 a fix at its region's wall costs as much as a one-sigma residual."""
    min_sigma_m: PositiveFloat = 0.01
    """Lower bound of the receiver's own sigmas."""
    gaussian_sigma_m: PositiveFloat = 1.0
    """Sigma of every fix under the model gaussian, which ignores accuracy (14)."""
    memory: MemoryConfig = MemoryConfig()
    quality: QualityConfig = QualityConfig()
    sky: SkyConfig = SkyConfig()
    regions: dict[FixClass, Region] = Field(default_factory=_default_regions)
    """Region of each fix class, r(p) and h(p), from a survey of the receiver; other classes are not used."""

    @property
    def has_memory(self) -> bool:
        """Whether errors are modelled as offsets with memory; the baselines are without."""
        return self.error_model == "memory" and self.model in {"cylinder", "ellipsoid"}

    @property
    def learns(self) -> bool:
        """Whether noise and walk are learned from the recording."""
        return self.has_memory and self.memory.learn

    @property
    def exponent(self) -> int:
        """Exponent of the bounds in stage D: of offsets, or of fixes."""
        return self.memory.n if self.has_memory else self.n

    def offset_errors(self, fix_class: FixClass) -> OffsetErrors:
        """Return the errors of a class with memory; a region that was set bounds the offsets, too."""
        errors = self.memory.classes.get(fix_class, OffsetErrors())
        region, default = self.regions[fix_class], _DEFAULT_REGIONS.get(fix_class)
        if default is not None and (region.r_m, region.h_m) == (default.r_m, default.h_m):
            return errors
        own = {"r_m": region.r_m, "h_m": region.h_m, "between_receivers": self.memory.own_spread}
        return errors.model_copy(update=own)
