import pytest

from vgps.runtime.timing import StageTimer, one_after_another


def test_stages_add_up_but_for_those_that_ran_beside_others():
    seconds = StageTimer()
    with seconds.measure("track"), seconds.measure("window beside"):
        pass
    with pytest.raises(ValueError), seconds.measure("track"):
        raise ValueError
    assert set(seconds.by_stage) == {"track", "window beside"}
    assert one_after_another({"track": 2.0, "wait": 0.5, "window beside": 3.0}) == 2.5
