"""Localization of a camera against a landmark database (Matsuda 2007)."""

from vgps.localization.localizer import Localizer
from vgps.localization.run import localize

__all__ = ["Localizer", "localize"]
