import struct

import numpy as np
import pytest
from metadata_videos import write_metadata_video

from vgps.readers.recording import open_recording
from vgps.readers.video_gps.camm import read_camm


def place(latitude, longitude, height):
    return struct.pack("<HH3d", 0, 5, latitude, longitude, height)


def gps(latitude, longitude, height, status=3, around=2.0, up=4.0):
    return struct.pack("<HHdidd7f", 0, 6, 1.4e9, status, latitude, longitude, height, around, up, 0, 0, 0, 0)


GYRO = struct.pack("<HH3f", 0, 2, 0.1, 0.2, 0.3)


def test_fixes_with_their_accuracies(tmp_path):
    packets = [(0.0, gps(47.5, 8.25, 500.0)), (0.1, GYRO), (0.3, gps(47.6, 8.25, 501.0, around=0.0, up=-1.0))]
    fixes = open_recording(write_metadata_video(tmp_path / "VID.mp4", packets, "camm")).gps
    assert fixes is not None
    np.testing.assert_allclose(fixes.t_s, [0.0, 0.3])
    np.testing.assert_allclose(fixes.latitude_deg, [47.5, 47.6])
    np.testing.assert_allclose(fixes.height_m, [500.0, 501.0])
    np.testing.assert_allclose(fixes.sigma_m[0], [np.sqrt(2.0), np.sqrt(2.0), 4.0])
    assert np.isnan(fixes.sigma_m[1]).all()


def test_plain_positions(tmp_path):
    raw = read_camm(write_metadata_video(tmp_path / "VID.mp4", [(0.0, place(47.5, 8.25, 500.0))], "camm"))
    assert raw is not None and raw.fixes[0][1:4] == (47.5, 8.25, 500.0)


@pytest.mark.parametrize(
    ("statuses", "heights_m", "sigma_m"), [((2, 2), [0.0, 0.0], 1e3), ((2, 3), [500.0], 4.0)]
)
def test_flat_fixes_have_no_height(tmp_path, statuses, heights_m, sigma_m):
    """Alone they are horizontal, beside others they are dropped."""
    packets = [(0.3 * k, gps(47.5 + 0.1 * k, 8.25, 500.0, status)) for k, status in enumerate(statuses)]
    fixes = open_recording(write_metadata_video(tmp_path / "VID.mp4", packets, "camm")).gps
    assert fixes is not None
    assert fixes.height_m.tolist() == heights_m and (fixes.sigma_m[:, 2] == sigma_m).all()
    np.testing.assert_allclose(fixes.sigma_m[:, :2], np.sqrt(2.0))


def test_full_positions_stand_for_plain_ones(tmp_path):
    packets = [
        (0.0, place(47.5, 8.25, 500.0)),
        (0.0, gps(47.5, 8.25, 500.0)),
        (0.1, place(47.6, 8.25, 500.0)),
    ]
    raw = read_camm(write_metadata_video(tmp_path / "VID.mp4", packets, "camm"))
    assert raw is not None and [fix.sigma_m[2] for fix in raw.fixes] == [4.0]


def test_what_is_no_fix(tmp_path):
    """No fix, nowhere, another sensor, and packets that end too early."""
    packets = [
        gps(47.5, 8.25, 500.0, status=0),
        place(0.0, 0.0, 0.0),
        GYRO,
        b"\0",
        place(47.5, 8.25, 1.0)[:-1],
    ]
    timed = [(0.1 * index, data) for index, data in enumerate(packets)]
    assert read_camm(write_metadata_video(tmp_path / "none.mp4", timed, "camm")) is None
    raw = read_camm(
        write_metadata_video(tmp_path / "one.mp4", [*timed, (0.9, place(47.5, 8.25, 1.0))], "camm")
    )
    assert raw is not None
    assert len(raw.fixes) == 1 and raw.fixes[0].t_s == pytest.approx(0.9)
    assert raw.notes[-1].endswith("damaged packets of CAMM metadata skipped")
