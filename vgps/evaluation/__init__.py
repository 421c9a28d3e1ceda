"""Errors of an estimate against a truth: computed without alignment first, then printed or as JSON."""

from vgps.evaluation.alignment import align
from vgps.evaluation.association import match_times
from vgps.evaluation.metrics import ErrorStatistics, Evaluation, Nees, trajectory_errors
from vgps.evaluation.run import evaluate
from vgps.evaluation.tables import comparison_table, evaluation_table, to_json

__all__ = [
    "ErrorStatistics",
    "Evaluation",
    "Nees",
    "align",
    "comparison_table",
    "evaluate",
    "evaluation_table",
    "match_times",
    "to_json",
    "trajectory_errors",
]
