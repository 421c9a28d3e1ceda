import numpy as np
from synthetic_fixes import fixes_of_size

import vgps
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.outlier_detection import FixAssessment
from vgps.model import FixClass
from vgps.online.verdict_events import VerdictEvents

PLACES = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.00004]])


def test_a_verdict_is_an_event_at_first_and_when_it_changes():
    fixes = fixes_of_size(np.array([0.5, 1.5]), PLACES, np.full(2, 0.1), np.full(2, 0.1))
    buffer, events = FixBuffer(fixes, np.zeros(3), vgps.Config()), VerdictEvents("cylinder")

    def changes(until_s):
        return events.changes(buffer, lambda _: FixClass.RTK_FIX, 0.0, until_s)

    (first,) = changes(1.0)  # the path has not reached the second fix
    assert (first.t_s, first.kind, first.text) == (1.0, "fix", "rtk_fix of 0.50 s used")
    assert first.details == {
        "fix_t_s": 0.5,
        "class": "rtk_fix",
        "verdict": "used",
        "probability": None,
        "east_m": 1.0,
        "north_m": 2.0,
        "up_m": 3.0,
    }
    buffer.update_assessment(np.arange(2), FixAssessment(np.array([0.1, 0.9]), np.array([0.0, 0.1])))
    changed, second = changes(2.0)
    assert changed.text == "rtk_fix of 0.50 s rejected, before used" and changed.details["probability"] == 0.1
    assert second.text == "rtk_fix of 1.50 s used" and second.details["up_m"] == 6.0
    assert changes(2.0) == []
