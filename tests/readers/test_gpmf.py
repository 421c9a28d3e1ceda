import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.errors import GpsLogError, RecordingError
from vgps.readers.gopro import gopro_speeds, read_gopro_gps, read_gopro_gyro
from vgps.readers.gpmf import Block, blocks, numbers, parse, payloads, sample_times
from vgps.readers.gps import read_gps_log
from vgps.readers.recording import open_recording

KINDS = {"b": "b", "B": "B", "s": "h", "S": "H", "l": "i", "L": "I", "f": "f", "d": "d", "j": "q", "J": "Q"}


def encode(key, kind, rows):
    """One entry, as the camera writes it."""
    if kind == "":
        body, size, count = b"".join(rows), 1, len(b"".join(rows))
    else:
        width = len(rows[0]) if rows else 1
        body = b"".join(struct.pack(f">{width}{KINDS[kind]}", *row) for row in rows)
        size, count = width * struct.calcsize(KINDS[kind]), len(rows)
    header = struct.pack(">4sBBH", key.encode(), ord(kind) if kind else 0, size, count)
    return header + body + b"\0" * (-len(body) % 4)


rows_of_shorts = st.integers(1, 4).flatmap(
    lambda k: st.lists(
        st.lists(st.integers(-(2**15), 2**15 - 1), min_size=k, max_size=k), min_size=1, max_size=9
    )
)


@given(rows_of_shorts)
def test_what_is_encoded_comes_back(rows):
    (entry,) = parse(encode("GYRO", "s", rows))
    assert (entry.key, entry.kind, entry.count) == ("GYRO", "s", len(rows))
    np.testing.assert_array_equal(numbers(entry), rows)


@given(rows_of_shorts, st.integers(0, 200))
def test_a_truncated_payload_is_told_or_ends(rows, cut):
    data = encode("STRM", "", [encode("STMP", "J", [[1]]), encode("GYRO", "s", rows)])
    try:
        for entry in parse(data[:cut]):
            list(parse(entry.data))
    except ValueError as error:
        assert "are left" in str(error)


def test_complex_structures_are_read_by_their_type():
    body = struct.pack(">iH", -7, 9) * 2
    (entry,) = parse(struct.pack(">4sBBH", b"GPS9", ord("?"), 6, 2) + body)
    np.testing.assert_array_equal(numbers(entry, "lS"), [[-7, 9], [-7, 9]])
    with pytest.raises(ValueError, match="has 6 bytes"):
        numbers(entry, "lL")
    with pytest.raises(ValueError, match="expected numbers"):
        numbers(entry, "lF")


def test_samples_lie_evenly_between_the_stamps_of_payloads():
    sensor = [Block(stamp, np.zeros((n, 1)), {}) for stamp, n in ((1.0, 4), (3.0, 2), (4.0, 2))]
    np.testing.assert_allclose(sample_times(sensor), [1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5])


def test_a_video_without_metadata_is_told(recording):
    video = recording / "video.mp4"
    assert payloads(video) == [] and read_gopro_gyro(video) is None
    with pytest.raises(GpsLogError, match="a video without GoPro metadata"):
        read_gopro_gps(video)
    with pytest.raises(GpsLogError, match="without GoPro metadata"):
        read_gps_log(video)


def test_a_file_that_is_no_video_is_told(tmp_path):
    broken = tmp_path / "v.mp4"
    broken.write_bytes(b"\0\0\0\x18ftypmp42" + b"\0" * 40)
    with pytest.raises(RecordingError, match=r"v\.mp4"):
        payloads(broken)


def test_the_real_walk_has_its_own_gps_and_gyro_on_the_clock_of_the_video(data_dir):
    opened = open_recording(data_dir / "gopro_walk")
    assert opened.gps is not None and opened.gyro is not None
    assert len(opened.video.times_s) == 315 and len(opened.gps) == 191
    assert abs(opened.gps.t_s[0]) < 0.1 and abs(opened.gps.t_s[-1] - opened.video.times_s[-1]) < 0.1
    assert np.median(np.diff(opened.gps.t_s)) == pytest.approx(1 / 18.2, rel=0.05)
    assert np.median(np.diff(opened.gyro.t_s)) == pytest.approx(1 / 197, rel=0.05)
    assert opened.gps.hdop[0] == 1.54
    # the step of a walk: positions agree with the Doppler speeds
    t_s, speed = gopro_speeds(data_dir / "gopro_walk/video.mp4")
    north = np.radians(opened.gps.latitude_deg) * 6371e3
    east = np.radians(opened.gps.longitude_deg) * 6371e3 * np.cos(np.radians(opened.gps.latitude_deg[0]))
    way = np.hypot(north[-1] - north[0], east[-1] - east[0])
    assert way == pytest.approx(np.trapezoid(speed, t_s), rel=0.15)


def test_every_sensor_of_the_real_walk_is_found(data_dir):
    found = blocks(data_dir / "gopro_walk/video.mp4")
    assert {"ACCL", "GYRO", "SHUT", "GPS5", "GRAV"} <= set(found)
    assert sum(len(block.samples) for block in found["SHUT"]) == 316
    gravity = np.concatenate([block.samples for block in found["ACCL"]]).mean(axis=0)
    assert np.linalg.norm(gravity) == pytest.approx(9.8, abs=0.5)
