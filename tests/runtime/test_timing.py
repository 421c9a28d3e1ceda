import pytest

from vgps.runtime.timing import StageTimer, sequential_seconds


def test_concurrent_stages_do_not_add_up():
    seconds = StageTimer()
    with seconds.measure("track"), seconds.measure("window beside"):
        pass
    with pytest.raises(ValueError), seconds.measure("track"):
        raise ValueError
    assert set(seconds.by_stage) == {"track", "window beside"}
    assert sequential_seconds({"track": 2.0, "wait": 0.5, "window beside": 3.0}) == 2.5
