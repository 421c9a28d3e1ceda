"""Logs of flights and receivers: bytes made after the specifications, positions as they were written."""

import sys
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_bytes import FIX, UNIX_S, dataflash, fit, igc, novatel, sbf, tlog, ulog

from vgps.crs import egm96
from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.gps_formats.fixes import Clock
from vgps.readers.gps_formats.igc import read_igc

GEOID_M = egm96().height_m(*np.array(FIX)[:, :2].T)
NOVATEL = pytest.mark.skipif(sys.platform == "darwin", reason="novatel-edie has no wheels for macOS")
LOGS = {
    "igc": (igc, FixClass.SINGLE, 0.0),
    "fit": (fit, FixClass.SINGLE, GEOID_M),
    "ulog": (ulog, FixClass.RTK_FIX, 0.0),
    "mavlink": (tlog, FixClass.RTK_FIX, 0.0),
    "sbf": (sbf, FixClass.RTK_FIX, 0.0),
    "novatel": (novatel, FixClass.RTK_FIX, 0.0),
}


def read(tmp_path, data, name="gps.log"):
    file = tmp_path / name
    file.write_bytes(data)
    return read_gps_log(file)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name for name in LOGS if name != "novatel"] + [pytest.param("novatel", marks=NOVATEL)]
)
def test_positions_times_and_classes(tmp_path, name):
    made, kind, added = LOGS[name]
    log = read(tmp_path, made())
    assert gps_format(tmp_path / "gps.log") == name
    np.testing.assert_allclose(log.t_s, [0, 1, 2], atol=1e-6)
    expected = np.array(FIX)
    # IGC has thousandths of minutes and metres
    coarse = name == "igc"
    np.testing.assert_allclose(log.latitude_deg, expected[:, 0], atol=1e-5 if coarse else 1e-7)
    np.testing.assert_allclose(log.longitude_deg, expected[:, 1], atol=1e-5 if coarse else 1e-7)
    np.testing.assert_allclose(log.height_m - added, expected[:, 2], atol=0.51 if coarse else 0.1)
    assert set(log.fix_class) == {kind}


def test_fit_as_garmin_writes_it(tmp_path):
    from garmin_fit_sdk import Encoder, Profile

    number, encoder = Profile["mesg_num"]["RECORD"], Encoder()
    for k, (latitude, longitude, altitude) in enumerate(FIX):
        semicircles = [round(angle * 2**31 / 180) for angle in (latitude, longitude)]
        place = dict(zip(("position_lat", "position_long"), semicircles, strict=True))
        when = datetime.fromtimestamp(UNIX_S + k, UTC)
        encoder.write_mesg(
            {"mesg_num": number, "timestamp": when, **place, "enhanced_altitude": altitude, "gps_accuracy": 3}
        )
    log = read(tmp_path, bytes(encoder.close()))
    assert gps_format(tmp_path / "gps.log") == "fit" and log.skipped[0].startswith(
        "heights are above the sea"
    )
    np.testing.assert_allclose(log.latitude_deg, np.array(FIX)[:, 0], atol=1e-7)
    np.testing.assert_allclose(log.height_m - GEOID_M, np.array(FIX)[:, 2], atol=0.1)
    np.testing.assert_allclose(log.sigma_m[:, 0], 3 / np.sqrt(2))


def test_ulog_as_pyulog_writes_it(tmp_path):
    from pyulog import ULog

    (tmp_path / "made.ulg").write_bytes(ulog())
    ULog(str(tmp_path / "made.ulg")).write_ulog(str(tmp_path / "again.ulg"))
    found, again = (read_gps_log(tmp_path / f"{name}.ulg") for name in ("made", "again"))
    np.testing.assert_array_equal(again.latitude_deg, found.latitude_deg)
    np.testing.assert_array_equal(again.sigma_m, found.sigma_m)


def test_times_are_utc(tmp_path):
    from vgps.readers.gps_formats.fit import read_fit
    from vgps.readers.gps_formats.mavlink import read_mavlink
    from vgps.readers.gps_formats.ulog import read_ulog

    readers = (
        (igc, read_igc),
        (fit, read_fit),
        (ulog, read_ulog),
        (tlog, read_mavlink),
        (dataflash, read_mavlink),
    )
    for number, (made, reader) in enumerate(readers):
        file = tmp_path / str(number)
        file.write_bytes(made())
        raw = reader(made(), file)
        assert raw.clock is Clock.UTC and raw.fixes[0].t_s == pytest.approx(UNIX_S, abs=1e-6)


def test_sigmas_and_what_was_skipped(tmp_path):
    log = read(tmp_path, ulog())
    np.testing.assert_allclose(log.sigma_m[0], [0.5 / np.sqrt(2), 0.5 / np.sqrt(2), 0.8], atol=1e-6)
    assert log.hdop[0] == pytest.approx(0.9) and log.satellites[0] == 14
    assert log.skipped == ("1 message without a fix or UTC skipped",)
    log = read(tmp_path, tlog())
    np.testing.assert_allclose(log.sigma_m[0], [0.02 / np.sqrt(2), 0.02 / np.sqrt(2), 0.03], atol=1e-6)
    assert log.skipped == ("1 message without a fix skipped",)
    assert "1 record without a position skipped" in read(tmp_path, fit()).skipped


def test_sigmas_of_sbf(tmp_path):
    log = read(tmp_path, sbf())
    np.testing.assert_allclose(log.sigma_m[0], [0.02, 0.01, 0.03], atol=1e-6)  # east, north, up
    np.testing.assert_allclose(log.correlation[0], [0.5, 0.0, 0.0], atol=1e-6)
    assert log.satellites[0] == 14 and log.correction_age_s[0] == pytest.approx(1.5)
    assert log.skipped == (
        "1 epoch without a fix skipped",
        "positions are in the datum of the reference stations, says the receiver",
    )
    bare = read(tmp_path, sbf(covariance=False, mode=5))
    # 2DRMS of 4 cm, two sigmas of 6 cm
    np.testing.assert_allclose(bare.sigma_m[0], [0.02 / np.sqrt(2), 0.02 / np.sqrt(2), 0.03], atol=1e-6)
    assert set(bare.fix_class) == {FixClass.RTK_FLOAT}
    unknown = read(tmp_path, sbf(covariance=False, up_cm=65535))
    np.testing.assert_allclose(unknown.sigma_m[0], [0.02 / np.sqrt(2), 0.02 / np.sqrt(2), np.nan], atol=1e-6)


@pytest.mark.slow
@NOVATEL
def test_novatel_in_ascii_and_binary(tmp_path):
    from novatel_edie import oem

    from vgps.readers.gps_formats.novatel import read_novatel

    text = novatel()
    assert read_novatel(text, tmp_path).fixes[0].t_s == pytest.approx(UNIX_S, abs=1e-6)
    parser = oem.Parser()
    parser.write(text)
    binary = b"".join(bytes(one.to_binary().message) for one in parser if hasattr(one, "to_binary"))
    for data in (text, binary):
        log = read(tmp_path, data)
        assert gps_format(tmp_path / "gps.log") == "novatel"
        np.testing.assert_allclose(log.sigma_m[0], [0.01, 0.02, 0.03], atol=1e-6)
        np.testing.assert_allclose(log.height_m, [row[2] for row in FIX], atol=1e-4)
        assert log.satellites[0] == 14 and log.correction_age_s[0] == 1.5
        assert log.skipped == ("1 epoch without a fix skipped",)
    assert set(read(tmp_path, novatel(kind="WIDE_INT")).fix_class) == {FixClass.RTK_FLOAT}
    damaged = read(tmp_path, text.replace(b"49.0001", b"49.7001"))
    assert len(damaged) == 2 and damaged.skipped[0] == "1 damaged message skipped"


def test_fields_of_px4_before_1_14(tmp_path):
    log = read(tmp_path, ulog(old=True))
    np.testing.assert_allclose(log.height_m, [row[2] for row in FIX], atol=1e-3)


def test_heights_above_the_sea_get_the_geoid(tmp_path):
    for made in (tlog(ellipsoid=False), dataflash()):
        log = read(tmp_path, made)
        np.testing.assert_allclose(log.height_m - GEOID_M, [row[2] for row in FIX], atol=0.01)
        assert any("EGM96's 48.2 m were added" in note for note in log.skipped)
    assert set(read(tmp_path, dataflash()).fix_class) == {FixClass.DGPS}
    np.testing.assert_allclose(
        read(tmp_path, igc(datum="GEO")).height_m - GEOID_M, [110, 111, 112], atol=0.01
    )


def test_igc_past_midnight_and_without_a_fix(tmp_path):
    raw = read_igc(igc(start=(23, 59, 59)), tmp_path)
    np.testing.assert_allclose(np.diff([fix.t_s for fix in raw.fixes]), 1.0)
    flat = igc().replace(b"A0010000112", b"V0010000112")
    assert "1 record without a three-dimensional fix skipped" in read_igc(flat, tmp_path).notes
    with pytest.raises(GpsLogError, match="no date; expected a record HFDTEddmmyy"):
        read_igc(igc().replace(b"HFDTE", b"HFPLT"), tmp_path)


def test_igc_south_and_west(tmp_path):
    (fix,) = read_igc(igc([(-34.5, -58.25, 20.0)]), tmp_path).fixes
    assert (fix.latitude_deg, fix.longitude_deg) == (-34.5, -58.25)


@pytest.mark.parametrize(
    ("made", "extra"),
    [
        (fit, "fitdecode"),
        (ulog, "pyulog"),
        (tlog, "pymavlink"),
        (sbf, "pysbf2"),
        pytest.param(novatel, "novatel_edie", marks=NOVATEL),
    ],
)
def test_a_missing_library_names_its_extra(tmp_path, monkeypatch, made, extra):
    data = made()
    for name in [name for name in sys.modules if name.split(".")[0] == extra]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, extra, None)
    with pytest.raises(GpsLogError, match=rf"needs the library {extra}, .* pip install 'vgps\[logs\]'"):
        read(tmp_path, data)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@settings(max_examples=25)
@given(st.data())
@pytest.mark.parametrize("made", [igc, fit, ulog, tlog, dataflash, sbf, pytest.param(novatel, marks=NOVATEL)])
def test_damage_is_read_around_or_refused_in_a_line(tmp_path_factory, made, data):
    whole = bytearray(made())
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(len(whole) // 4, len(whole) - 1))] = data.draw(st.integers(0, 255))
    whole = whole[: data.draw(st.integers(40, len(whole)))]
    try:
        log = read(tmp_path_factory.mktemp("damage"), bytes(whole))
    except GpsLogError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(log.t_s).all()
