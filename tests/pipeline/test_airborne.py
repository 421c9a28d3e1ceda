from dataclasses import replace

import pytest

import vgps
import vgps.pipeline.offline
from vgps.config import Config, StartConfig
from vgps.pipeline.airborne import with_airborne


@pytest.mark.slow
@pytest.mark.parametrize(
    "given, drone, flies",
    [("auto", True, True), ("auto", False, False), ("no", True, False), ("yes", False, True)],
)
def test_a_drones_fixes_decide_whether_the_camera_flies(recording, given, drone, flies):
    opened = vgps.open_recording(recording)
    opened = replace(opened, gps=replace(opened.gps, airborne=drone))
    assert with_airborne(opened, Config(start=StartConfig(airborne=given))).start.flies == flies


def test_without_fixes_a_camera_does_not_fly(recording):
    opened = replace(vgps.open_recording(recording), gps=None)
    assert with_airborne(opened, Config()) == Config()  # the settings stay the user's


def test_smoothing_decides_before_all_else(recording, monkeypatch):
    opened = vgps.open_recording(recording)
    opened = replace(opened, gps=replace(opened.gps, airborne=True))

    def first_step(_, config, progress):
        raise InterruptedError(config.start.airborne)

    monkeypatch.setattr(vgps.pipeline.offline, "with_found_camera", first_step)
    with pytest.raises(InterruptedError, match="yes"):
        vgps.smooth(opened)
