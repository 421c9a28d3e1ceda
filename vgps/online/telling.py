"""Verdicts on fixes as events: told when a fix is first passed, and when its verdict changes."""

import numpy as np

from vgps.model import FixClass
from vgps.online.estimate import OnlineEvent
from vgps.smoothing.ledger import FixLedger
from vgps.solution import Verdict


class VerdictTeller:
    """Remembers what was told of the fixes that a ledger still holds."""

    def __init__(self) -> None:
        self._told: dict[int, Verdict] = {}

    def news(
        self, ledger: FixLedger, fix_class: tuple[FixClass, ...], since_s: float, until_s: float
    ) -> list[OnlineEvent]:
        """What there is to tell of fixes between two times of the video.

        Args:
            ledger: The fixes.
            fix_class: (M,) theirs.
            since_s, until_s: The path in the world so far.
        """
        fixes, judgement = ledger.fixes, ledger.judgement
        inside = (fixes.t_s >= since_s) & (fixes.t_s <= until_s)
        rejected, lowered = judgement.rejected, judgement.lowered
        events, told = [], {}
        for row in np.flatnonzero(inside).tolist():
            verdict = Verdict.USED if fixes.used[row] else Verdict.NOT_USED
            if fixes.used[row] and rejected[row]:
                verdict = Verdict.REJECTED
            elif fixes.used[row] and lowered[row]:
                verdict = Verdict.DOWN_CLASSED
            number = int(ledger.number[row])
            before = self._told.get(number)
            told[number] = verdict
            if verdict is before:
                continue
            t_s, probability = float(fixes.t_s[row]), float(judgement.own[row])
            was = "" if before is None else f", before {before}"
            text = f"{fix_class[row]} of {t_s:.2f} s {verdict}{was}"
            details = {
                "fix_t_s": t_s,
                "class": str(fix_class[row]),
                "verdict": str(verdict),
                "probability": probability if np.isfinite(probability) else None,
            }
            events.append(OnlineEvent(until_s, "fix", text, details))
        self._told = told
        return events
