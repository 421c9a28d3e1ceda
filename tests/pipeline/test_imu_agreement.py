"""Maps and pairs of pictures beside the IMU of a recording: which of them is believed."""

from types import SimpleNamespace

import pytest

from vgps.config import Config
from vgps.imu.agreement import Agreement
from vgps.pipeline import imu_agreement as module
from vgps.pipeline.imu_agreement import imu_agreement
from vgps.runtime.progress import NoProgress

TURNED, UNLIKE = Agreement("it is mounted otherwise"), Agreement("its rates and those of the video differ")
LATE, NOTHING = Agreement(None, 0.004, 0.001), Agreement(None)


@pytest.mark.parametrize(
    ("by_maps", "by_pictures", "believed"),
    [
        (LATE, TURNED, LATE),  # pictures are not asked
        (TURNED, LATE, LATE),
        (TURNED, UNLIKE, UNLIKE),
        (TURNED, NOTHING, TURNED),  # pictures show nothing, as in the dark
    ],
)
def test_pictures_decide_where_maps_contradict_an_imu(monkeypatch, by_maps, by_pictures, believed):
    front_end = SimpleNamespace(recording=None, origin=None, maps=())
    monkeypatch.setattr(module, "camera_imu", lambda *_: "an IMU")
    monkeypatch.setattr(module, "path_rotations", lambda _: "maps")
    monkeypatch.setattr(module, "agreement", lambda rotations, _: by_maps if rotations == "maps" else None)
    monkeypatch.setattr(module, "pictures_agreement", lambda *_: by_pictures)
    assert imu_agreement(front_end, Config(), NoProgress()) is believed
