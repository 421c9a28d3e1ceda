"""Survey of a receiver, as in Kume 2010: regions of its fix classes from logs taken at a fixed point."""

from vgps.survey.regions import ClassSurvey, Ellipsoid, least_ellipsoid, region
from vgps.survey.survey import Survey, survey_logs

__all__ = [
    "ClassSurvey",
    "Ellipsoid",
    "Survey",
    "least_ellipsoid",
    "region",
    "survey_logs",
]
