"""Settings of the smoother that is fed live."""

from pydantic import PositiveFloat

from vgps.config.base import SettingsModel


class OnlineConfig(SettingsModel):
    """What is special about a sequence that is fed live."""

    keep_s: PositiveFloat = 120.0
    """Path and fixes are remembered for so long: what judges late fixes and is bent when GPS returns."""
    bridge_s: PositiveFloat = 1.0
    """Frames without features go on at constant velocity for so long; then the camera counts as lost."""
    blend_s: PositiveFloat = 2.0
    """Time in which the smooth pose approaches the corrected one by all but 1/e,"""
    blend_m_s: PositiveFloat = 1.0
    """but never faster than this,"""
    blend_deg_s: PositiveFloat = 5.0
    """nor turning faster than this."""
