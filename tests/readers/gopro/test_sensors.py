"""A GoPro's streams from payloads written by hand, and from the recording of a MAX."""

import numpy as np
import pytest
from gpmf_bytes import ROW, device, encode, gps5, shutter, stream, structures, telemetry, text, walk

from vgps.errors import GpsLogError, GyroLogError, RecordingError
from vgps.model import FixClass
from vgps.readers.gopro.sensors import (
    GYRO_R_CAMERA,
    gopro_exposures,
    picture_rotations,
    read_gopro_gps,
    read_gopro_gyro,
)


def test_gps5_by_hand():
    raw = read_gopro_gps(walk())
    assert [fix.t_s for fix in raw.fixes] == pytest.approx([0.1, 0.35, 0.6, 0.85, 1.1, 1.35, 1.6, 1.85])
    assert raw.fixes[0][1:4] == pytest.approx(ROW[:3])
    assert {fix.fix_class for fix in raw.fixes} == {FixClass.SINGLE}
    assert [fix.line for fix in raw.fixes] == list(range(1, 9))
    assert raw.fixes[0].hdop == 1.54 and np.isnan(raw.fixes[0].sigma_m).all()
    assert raw.notes == []


@pytest.mark.parametrize(
    ("fix", "dop", "kept", "note"),
    [
        (3, 9999, 4, "4 of 8 GPS samples had no fix"),
        (0, 154, 4, "4 of 8 GPS samples had no fix"),
        (2, 300, 8, "4 two-dimensional fixes with guessed heights"),
    ],
)
def test_the_fix_and_the_dilution_of_a_payload_are_those_of_its_samples(fix, dop, kept, note):
    raw = read_gopro_gps(walk(fix, dop))
    assert len(raw.fixes) == kept
    assert raw.notes == [note]


@pytest.mark.parametrize("key", ["GPSF", "GPSP"])
def test_a_fix_or_a_dilution_that_is_cut_short_is_not_known(key):
    about = (encode("GPSF", "L", [[3]]), encode("GPSP", "S", [[154]]))
    cut = [encode(key, "L", []) if piece[:4] == key.encode() else piece for piece in about]
    scale = encode("SCAL", "l", [[10_000_000]] * 2 + [[1000], [1000], [100]])
    raw = read_gopro_gps(
        telemetry(device("Hero9", stream(encode("GPS5", "l", [[1, 2, 3, 4, 5]]), *cut, scale)))
    )
    assert len(raw.fixes) == 1
    assert raw.fixes[0].hdop == pytest.approx(1.54) if key == "GPSF" else np.isnan(raw.fixes[0].hdop)


def gps9(rows):
    """As a HERO11 writes it: a fix and a dilution for every sample."""
    scale = [10_000_000, 10_000_000, 1000, 1000, 100, 1, 1000, 100, 1]
    integers = [[round(x * s) for x, s in zip(row, scale, strict=True)] for row in rows]
    about = text("TYPE", "lllllllSS"), encode("SCAL", "l", [[s] for s in scale])
    return stream(structures("GPS9", "lllllllSS", integers), *about, stamp_us=600_000)


def test_gps9_has_fix_and_dilution_of_its_own():
    rows = [(*ROW, 8401, 82514.5, 1.25, 3), (*ROW, 8401, 82514.6, 9.5, 0), (*ROW, 8401, 82514.7, 2.5, 2)]
    found = telemetry(device("HERO11", shutter(500_000), gps9(rows), gps5([ROW], stamp_us=600_000)))
    raw = read_gopro_gps(found)
    assert [(fix.line, fix.hdop) for fix in raw.fixes] == [(1, 1.25), (3, 2.5)]
    assert raw.fixes[0][1:4] == pytest.approx(ROW[:3])


def test_the_karma_drones_stream():
    """Its columns as ExifTool's GoPro.pm documents them; no stamps, spread over the payload."""
    rows = [
        [1_000_000 + k, 331_267_000 + 10 * k, -1_173_273_000, 120_500, 90, 150, 430, 18_000, fix, 14]
        for k, fix in enumerate([3, 3, 3, 3, 1])  # MAVLink's: 1 is no fix
    ]
    scale = [[s] for s in (1_000_000, 10_000_000, 10_000_000, 1000, 100, 100, 100, 100, 1, 1)]
    gpri = stream(
        structures("GPRI", "JlllSSSSBB", rows), text("TYPE", "JlllSSSSBB"), encode("SCAL", "l", scale)
    )
    found = telemetry(device("GoPro Karma v1.0", gpri), duration_s=2.5)
    raw = read_gopro_gps(found)
    assert [fix.t_s for fix in raw.fixes] == [0.0, 0.5, 1.0, 1.5]
    # 120.5 m above the sea, and EGM96's -34.66 m: as in GoPro's samples of a Karma and of a HERO5 beside it
    assert raw.fixes[1][1:4] == pytest.approx((33.126701, -117.3273, 85.84), abs=0.01)
    assert raw.notes == [
        "1 of 5 GPS samples had no fix",
        "no time stamps (STMP): times are those of the payloads, accurate to some tenths of a second",
        "heights are above the sea: EGM96's -34.7 m were added, they may be wrong by some metres",
    ]


def test_a_hero5_without_stamps():
    found = telemetry(device("Camera", gps5([ROW] * 2)), device("Camera", gps5([ROW] * 4)), duration_s=1.001)
    raw = read_gopro_gps(found)
    assert [fix.t_s for fix in raw.fixes] == pytest.approx([0, 0.5005, 1.001, 1.25125, 1.5015, 1.75175])
    assert "no time stamps" in raw.notes[0]


def test_heights_above_the_sea_are_noted():
    sea = stream(encode("GPS5", "l", [[1, 2, 3, 4, 5]]), text("GPSA", "MSLV"), stamp_us=1)
    assert "above the sea" in read_gopro_gps(telemetry(device("HERO10", sea))).notes[0]


def test_places_never_found_are_no_fixes():
    """Some firmware says fix 3 and writes zeros."""
    assert read_gopro_gps(telemetry(device("HERO8", gps5([(0.0,) * 5], stamp_us=1)))).fixes == []


def gyro(order: str | None, name: str = "HERO8"):
    about = [encode("SCAL", "s", [[100]])] + ([text("ORIN", order)] if order else [])
    return telemetry(
        device(name, shutter(0), stream(encode("GYRO", "s", [[100, 200, 300]] * 4), *about, stamp_us=0))
    )


@pytest.mark.parametrize(
    ("order", "name", "expected"),
    [
        ("XYZ", "HERO9", (1, 2, 3)),
        ("XzY", "GoPro Max", (1, 3, -2)),
        ("yXZ", "HERO8", (2, -1, 3)),
        (None, "Camera", (2, 3, 1)),  # HERO5: Z, X, Y
        (None, "Hero6 Black", (-2, 1, 3)),  # Y, -X, Z
        (None, "Fusion", (2, -1, 3)),  # -Y, X, Z
    ],
)
def test_the_gyros_axes_are_put_in_order(order, name, expected):
    found = read_gopro_gyro(gyro(order, name))
    assert found is not None
    np.testing.assert_allclose(found.rate_rad_s, [expected] * 4)
    np.testing.assert_allclose(found.t_s, [0, 0.25, 0.5, 0.75])


@pytest.mark.parametrize("order", ["XY", "XXY", "abc"])
def test_an_impossible_order_of_axes_is_refused(order):
    with pytest.raises(
        GyroLogError, match=rf"walk\.mp4, GYRO: 3 columns in the order '{order}'; expected 3 axes"
    ):
        read_gopro_gyro(gyro(order))


def test_a_stream_of_changing_width_is_refused():
    payloads = [device("C", stream(encode("GPS5", "l", [[1] * n]), stamp_us=1)) for n in (5, 3)]
    with pytest.raises(RecordingError, match=r"walk\.mp4, GPS5: 3 and 5 columns; expected at least 5"):
        read_gopro_gps(telemetry(*payloads))


def test_exposures_are_those_of_the_frames():
    times, exposures = gopro_exposures(telemetry(device("C", shutter(700_000, 0.02))))
    np.testing.assert_allclose(times, np.arange(30) / 30)
    np.testing.assert_allclose(exposures, 0.02)
    assert gopro_exposures(telemetry(device("C", gps5([ROW])))) is None


def test_what_a_camera_without_sensors_lacks():
    empty = telemetry(device("C", shutter(0)))
    assert read_gopro_gyro(empty) is None and picture_rotations(empty) is None
    with pytest.raises(
        GpsLogError, match=r"walk\.mp4: GoPro metadata without GPS; expected GPS9, GPS5 or GPRI"
    ):
        read_gopro_gps(empty)
    with pytest.raises(GpsLogError, match=r"a video without GoPro metadata; .*; give a GPS log with --gps"):
        read_gopro_gps(telemetry())


def test_the_gyros_axes_are_a_rotation_of_the_cameras():
    np.testing.assert_allclose(GYRO_R_CAMERA @ GYRO_R_CAMERA.T, np.eye(3))
    assert np.linalg.det(GYRO_R_CAMERA) == pytest.approx(1)
