"""Events of verdicts on fixes: the first verdict on each, and its changes."""

from collections.abc import Callable

import numpy as np

from vgps.config import GpsModel
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.verdicts import verdicts_of
from vgps.model import FixClass
from vgps.online.estimate import OnlineEvent
from vgps.solution import Verdict


class VerdictEvents:
    """Verdicts reported so far on the fixes that a buffer still holds.

    Args:
        model: GPS model; with ``none`` no fix is used.
    """

    def __init__(self, model: GpsModel) -> None:
        self._model = model
        self.reported: dict[int, Verdict] = {}

    def changes(
        self, fix_buffer: FixBuffer, class_of: Callable[[int], FixClass], since_s: float, until_s: float
    ) -> list[OnlineEvent]:
        """Return events for new and changed verdicts on fixes between two times of the video.

        Args:
            fix_buffer: The fixes.
            class_of: Class of a fix by its number.
            since_s, until_s: Time span of the aligned path.
        """
        fixes, assessment = fix_buffer.fixes, fix_buffer.assessment
        rows = np.flatnonzero((fixes.t_s >= since_s) & (fixes.t_s <= until_s))
        verdicts, contributes = verdicts_of(assessment), fixes.used & (self._model != "none")
        now = {
            int(fix_buffer.number[row]): verdicts[row] if contributes[row] else Verdict.NOT_USED
            for row in rows.tolist()
        }
        before, self.reported = self.reported, now
        return [
            _event(until_s, class_of(number), (before.get(number), verdict), fix_buffer, row)
            for row, (number, verdict) in zip(rows.tolist(), now.items(), strict=True)
            if before.get(number) != verdict
        ]


def _event(
    t_s: float, kind: FixClass, change: tuple[Verdict | None, Verdict], fix_buffer: FixBuffer, row: int
) -> OnlineEvent:
    before, verdict = change
    was = "" if before is None else f", before {before}"
    fix_t_s, probability = float(fix_buffer.fixes.t_s[row]), float(fix_buffer.assessment.nominal[row])
    east_m, north_m, up_m = np.round(fix_buffer.fixes.world_p_fix[row], 4).tolist()
    details = {
        "fix_t_s": fix_t_s,
        "class": str(kind),
        "verdict": str(verdict),
        "probability": probability if np.isfinite(probability) else None,
        "east_m": east_m,
        "north_m": north_m,
        "up_m": up_m,
    }
    return OnlineEvent(t_s, "fix", f"{kind} of {fix_t_s:.2f} s {verdict}{was}", details)
