"""Survey of a receiver: regions of its fix classes as in Kume 2010, and how their errors change over time."""

from vgps.survey.errors import ErrorSeries, read_errors
from vgps.survey.memory import Changes, Memory, find_changes, find_stretches, fit_memory
from vgps.survey.regions import ClassSurvey, Ellipsoid, least_ellipsoid, region
from vgps.survey.survey import Survey, survey_errors, survey_logs

__all__ = [
    "Changes",
    "ClassSurvey",
    "Ellipsoid",
    "ErrorSeries",
    "Memory",
    "Survey",
    "find_changes",
    "find_stretches",
    "fit_memory",
    "least_ellipsoid",
    "read_errors",
    "region",
    "survey_errors",
    "survey_logs",
]
