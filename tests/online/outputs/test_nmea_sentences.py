"""Sentences of poses, read by pynmeagps and by vgps' own reader of receivers."""

import io
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from pynmeagps import VALCKSUM, NMEAReader

import vgps
from vgps.crs.geoid import Geoid
from vgps.geodesy import to_geodetic
from vgps.model import FixClass, GeodeticPoint
from vgps.online.estimate import OnlineEstimate, OnlineState
from vgps.online.outputs.nmea_sentences import sentences
from vgps.online.sources.gps_messages import Epochs, messages

START = datetime(2026, 5, 1, 23, 59, 58, 250_000, tzinfo=UTC)
GEOID = Geoid("level", lambda latitude, longitude: np.full(np.shape(latitude), 47.5))
# looks east from 1 m east, 2 m north, 3 m up
POSE = np.array([[0.0, 0.0, 1.0, 1.0], [-1.0, 0.0, 0.0, 2.0], [0.0, -1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
ESTIMATE = OnlineEstimate(
    frame=5,
    t_s=1.5,
    state=OnlineState.TRACKED,
    global_T_camera=POSE,
    local_T_camera=POSE,
    sigma_position_m=np.array([0.01, 0.02, 0.03]),
    sigma_rotation_rad=np.full(3, 0.01),
    world_origin=GeodeticPoint(-33.9999999, -8.0000001, 100.0),
    events=(),
    seconds=0.01,
)


def sent(start_utc=START, **changes):
    """The sentences by their identity, as pynmeagps reads them; it refuses wrong checksums."""
    data = sentences(replace(ESTIMATE, **changes), start_utc, GEOID, vgps.Config().gps)
    assert data.endswith(b"\r\n")
    read = [message for _, message in NMEAReader(io.BytesIO(data), validate=VALCKSUM, quitonerror=2)]
    return {message.msgID: message for message in read}


def test_a_pose_is_where_and_when_it_was():
    found = sent()
    gga, latitude, longitude = found["GGA"], *to_geodetic(ESTIMATE.world_origin, POSE[:3, 3])[:2].tolist()
    assert (gga.lat, gga.lon) == (pytest.approx(latitude, abs=2e-9), pytest.approx(longitude, abs=2e-9))
    assert gga.alt + gga.sep == pytest.approx(103.0, abs=1e-3) and gga.sep == 47.5
    assert gga.time.isoformat() == "23:59:59.750000"
    assert found["HDT"].headingT == 90.0
    assert [getattr(found["GST"], name) for name in ("stdLong", "stdLat", "stdAlt")] == [0.01, 0.02, 0.03]


@pytest.mark.parametrize(
    ("sigma_m", "state", "quality"),
    [
        (0.02, OnlineState.TRACKED, 4),  # 95 % within 0.049 m
        (0.04, OnlineState.TRACKED, 5),  # 0.098 m, beyond the region of RTK-fixes
        (0.97, OnlineState.TRACKED, 5),
        (0.99, OnlineState.TRACKED, 1),  # 2.42 m, beyond that of RTK-floats
        (0.02, OnlineState.BRIDGED, 6),
        (np.nan, OnlineState.TRACKED, 1),
    ],
)
def test_the_quality_says_what_the_pose_is(sigma_m, state, quality):
    assert sent(sigma_position_m=np.full(3, sigma_m), state=state)["GGA"].quality == quality


def test_without_a_pose_there_is_a_gga_of_quality_zero_only():
    for state in (OnlineState.STARTING, OnlineState.UNALIGNED, OnlineState.LOST):
        found = sent(state=state, global_T_camera=np.full((4, 4), np.nan))
        assert list(found) == ["GGA"] and found["GGA"].quality == 0 and found["GGA"].lat == ""


def test_a_camera_that_looks_down_has_no_heading_and_an_unknown_clock_no_time():
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    found = sent(None, global_T_camera=down)
    assert set(found) == {"GGA", "GST"} and found["GGA"].time == ""


def test_the_reader_of_receivers_reads_it_back():
    data, epochs = sentences(ESTIMATE, START, GEOID, vgps.Config().gps), Epochs()
    fixes = [fix for raw in messages(io.BytesIO(data)) for fix in epochs.add(raw)] + epochs.flush()
    (fix,) = [one.fix for one in fixes]
    assert fix.fix_class is FixClass.RTK_FIX and fix.height_m == pytest.approx(103.0, abs=1e-3)
    assert fix.sigma_m == (0.01, 0.02, 0.03)
    # 0.2 mm of latitude is what the last digit stands for
    latitude = to_geodetic(ESTIMATE.world_origin, POSE[:3, 3])[0]
    assert fix.latitude_deg == pytest.approx(latitude, abs=2e-9)
