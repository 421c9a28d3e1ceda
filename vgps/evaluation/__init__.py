"""How far an estimate is from a truth: errors without alignment first, tables for one run or several."""

from vgps.evaluation.metrics import Evaluation, Nees, Spread, align, evaluate, match
from vgps.evaluation.run import evaluate_run
from vgps.evaluation.tables import as_json, as_table, table

__all__ = [
    "Evaluation",
    "Nees",
    "Spread",
    "align",
    "as_json",
    "as_table",
    "evaluate",
    "evaluate_run",
    "match",
    "table",
]
