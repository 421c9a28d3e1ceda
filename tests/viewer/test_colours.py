"""The meaning of colours."""

import numpy as np
import pytest

from vgps.model import FixClass
from vgps.solution import Verdict
from vgps.viewer import colours


def test_errors_go_from_green_over_yellow_to_red() -> None:
    good, middle, bad, worse, unknown = colours.green_to_red(
        np.array([0, 1, 2, 50, np.nan]), 0.0, 2.0
    ).tolist()
    assert good == [60, 220, 90]
    assert middle == [250, 220, 40]
    assert bad == worse == [255, 40, 40]
    assert unknown == [128, 128, 128]


@pytest.mark.parametrize("fix_class", list(FixClass))
def test_a_verdict_other_than_used_has_its_own_colour(fix_class: FixClass) -> None:
    assert colours.of_fix(fix_class, Verdict.USED) == colours.CLASS[fix_class]
    others = {colours.of_fix(fix_class, verdict) for verdict in Verdict if verdict is not Verdict.USED}
    assert others == {colours.REJECTED, colours.DOWN_CLASSED, colours.NOT_USED}


def test_no_two_meanings_share_a_colour() -> None:
    meanings = [*colours.CLASS.values(), colours.REJECTED, colours.DOWN_CLASSED, colours.NOT_USED]
    assert len(set(meanings)) == len(meanings)
