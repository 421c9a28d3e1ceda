"""A receiver surveyed, as in Kume 2010: what its fix classes are worth, from logs taken standing still."""

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
