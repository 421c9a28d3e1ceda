import struct

import numpy as np
import pytest
from clips import write_clip
from dashcams import doubles_block, floats_block, write_dashcam_video

from vgps.readers.recording import open_recording
from vgps.readers.video_gps.dashcam import read_dashcam

ZURICH = (4721.5, "N", 832.25, "E")  # 47 degrees 21.5 minutes, 8 degrees 32.25 minutes
DATE = (2024, 5, 1)
AKASO = bytes.fromhex(  # as ExifTool quotes one
    "00008000 66726565 47505320 78000000 596e6441 6b61736f 43617200 00000000"
    "30303030 30000000 00000000 00000000 0e000000 27000000 2c000000 e3070000"
    "05000000 1d000000 414e4500 00000000 f14e3e3d 90dfca40 e350bf0b 0b31a040"
)


@pytest.mark.parametrize(
    "block",
    [
        floats_block(ZURICH, (9, 59, 58), DATE, at=16),
        floats_block(ZURICH, (9, 59, 58), DATE, at=48),
        doubles_block(ZURICH, (9, 59, 58), DATE),
    ],
)
def test_a_block_of_each_layout(tmp_path, block):
    raw = read_dashcam(write_dashcam_video(tmp_path / "car.mp4", [block]))
    assert raw is not None
    (fix,) = raw.fixes
    assert fix[:4] == pytest.approx((0.0, 47.0 + 21.5 / 60.0, 8.0 + 32.25 / 60.0, 0.0), abs=1e-6)
    assert fix.line == 1 and fix.sigma_m[2] == 1000.0


def test_hemispheres_and_years_of_four_digits(tmp_path):
    block = floats_block((3352.0, "S", 15112.0, "W"), (0, 0, 0), DATE, at=16, century=2000)
    raw = read_dashcam(write_dashcam_video(tmp_path / "car.mp4", [block]))
    assert raw is not None
    assert raw.fixes[0][1:3] == pytest.approx((-(33 + 52 / 60), -(151 + 12 / 60)), abs=1e-5)


def test_times_count_from_the_start_across_a_loss_and_midnight(tmp_path):
    """The first fix is the second block's."""
    lost = floats_block((0.0, "\0", 0.0, "\0"), (0, 0, 0), (2000, 0, 0), at=16, status="V")
    blocks = [
        lost,
        floats_block((4721.5, "N", 832.25, "E"), (23, 59, 59), (2024, 2, 29), at=16),
        floats_block((4721.6, "N", 832.25, "E"), (0, 0, 0), (2024, 3, 1), at=16),
        lost,
        floats_block((4721.7, "N", 832.25, "E"), (0, 0, 2), (2024, 3, 1), at=16),
    ]
    raw = read_dashcam(write_dashcam_video(tmp_path / "car.mp4", blocks, seconds=5))
    assert raw is not None
    assert [fix.t_s for fix in raw.fixes] == pytest.approx([1.0, 2.0, 4.0])
    assert [fix.line for fix in raw.fixes] == [2, 3, 5]
    assert raw.notes[-1] == "2 blocks without a fix skipped"


def test_a_recording_has_these_fixes(tmp_path):
    """The first block's clock is wrong by years."""
    blocks = [
        floats_block((4721.5 + 0.01 * k, "N", 832.25, "E"), (9, 0, k), (2024 - 4 * (k == 0), 5, 1), at=16)
        for k in range(4)
    ]
    found = open_recording(write_dashcam_video(tmp_path / "car.mp4", blocks, seconds=4)).gps
    assert found is not None
    np.testing.assert_allclose(found.t_s[1:], [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    "block",
    [
        struct.pack("<I", 256) + b"freeGPS " + bytes(244),
        floats_block(ZURICH, (9, 59, 58), (2024, 13, 1), at=16),
        floats_block((9721.5, "N", 832.25, "E"), (9, 59, 58), DATE, at=16),
        floats_block((float("nan"), "N", 832.25, "E"), (9, 59, 58), DATE, at=16),
        AKASO,
        floats_block(ZURICH, (9, 59, 58), DATE, at=16).replace(
            struct.pack("<2f", 4721.5, 832.25), b"4721.500"
        ),
    ],
)
def test_blocks_that_cannot_be_read_are_named(tmp_path, caplog, block):
    assert read_dashcam(write_dashcam_video(tmp_path / "car.mp4", [block])) is None
    assert "none of its 1 GPS blocks (freeGPS) has a fix in a layout that is read" in caplog.text


def test_places_that_are_not_blocks(tmp_path, caplog):
    """A video without a list, and one whose list leads elsewhere or beyond the file."""
    assert read_dashcam(write_clip(tmp_path / "plain.mp4")) is None
    file = write_dashcam_video(tmp_path / "car.mp4", [floats_block(ZURICH, (9, 59, 58), DATE, at=16)])
    file.write_bytes(file.read_bytes().replace(b"freeGPS ", b"freeGPX "))
    assert read_dashcam(file) is None
    file.write_bytes(file.read_bytes()[:-200])
    assert read_dashcam(file) is None and not caplog.text
