import struct
from pathlib import Path

import numpy as np
import pytest
from gpmf_bytes import device, encode, entry, nest, stream, structures, telemetry, text
from hypothesis import given
from hypothesis import strategies as st

from vgps.errors import RecordingError
from vgps.readers.gopro.gpmf import collect, first_number, numbers, parse, read_gpmf
from vgps.readers.gopro.sample_times import sample_times
from vgps.readers.gopro.sensors import read_gopro_gyro
from vgps.readers.video.metadata_tracks import Packet

LIMITS = {"b": 7, "B": 8, "s": 15, "S": 16, "l": 31, "L": 32, "j": 53, "J": 53}


keys = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", min_size=4, max_size=4)


@st.composite
def tables(draw):
    """A kind and rows of numbers that it can hold, and that a float64 holds exactly."""
    kind = draw(st.sampled_from(sorted(LIMITS)))
    low = 0 if kind.isupper() else -(2 ** LIMITS[kind])
    numbers_of_kind = st.integers(low, 2 ** LIMITS[kind] - 1)
    width = draw(st.integers(1, 5))
    return kind, draw(
        st.lists(st.lists(numbers_of_kind, min_size=width, max_size=width), min_size=1, max_size=9)
    )


@pytest.mark.slow
@given(st.lists(st.tuples(keys, tables()), max_size=5))
def test_what_is_encoded_comes_back(content):
    data = b"".join(encode(key, kind, rows) for key, (kind, rows) in content)
    found = list(parse(data))
    assert [(e.key, e.kind, e.count) for e in found] == [(k, t[0], len(t[1])) for k, t in content]
    for e, (_, (_, rows)) in zip(found, content, strict=True):
        np.testing.assert_array_equal(numbers(e), rows)


@pytest.mark.slow
@given(st.text("bBsSlLjJ", min_size=1, max_size=6), st.integers(1, 4), st.data())
def test_structures_of_several_types_come_back(types, count, data):
    row = st.tuples(*(st.integers(0, 2 ** min(7, LIMITS[letter]) - 1) for letter in types))
    rows = data.draw(st.lists(row, min_size=count, max_size=count))
    (found,) = parse(structures("DATA", types, rows))
    np.testing.assert_array_equal(numbers(found, types), rows)


@pytest.mark.slow
@given(st.lists(st.floats(width=32, allow_nan=False), min_size=1, max_size=6))
def test_floats_come_back(row):
    (found,) = parse(encode("MTRX", "f", [row]))
    np.testing.assert_array_equal(numbers(found), [row])


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(data):
    """Entries tile what is read; the only refusal is a ValueError, which the video's reader counts."""
    try:
        found = list(parse(data))
    except ValueError as error:
        assert "expected at most" in str(error)
        return
    assert sum(8 + -(-len(e.data) // 4) * 4 for e in found) <= len(data) + 3
    assert collect(Path("v.mp4"), [Packet(data, 0.0, 1.0)]).damaged <= 1


@pytest.mark.slow
@given(tables(), st.integers(0, 200))
def test_a_truncated_payload_is_refused_or_ends(table, cut):
    data = nest("STRM", encode("STMP", "J", [[1]]), encode("GYRO", *table))
    try:
        for outer in parse(data[:cut]):
            list(parse(outer.data))
    except ValueError as error:
        assert "expected at most" in str(error)
    else:
        assert cut < 8 or cut >= len(data.rstrip(b"\0")) - 8


def test_padding_ends_a_payload_and_an_odd_length_is_padded():
    data = text("STNM", "abcde") + encode("TSMP", "L", [[7]]) + b"\0" * 12 + encode("LOST", "L", [[1]])
    assert [(e.key, e.data) for e in parse(data)] == [("STNM", b"abcde"), ("TSMP", b"\0\0\0\x07")]


def test_structures_by_hand_and_those_that_do_not_fit():
    body = struct.pack(">iH", -7, 9) * 2
    (found,) = parse(entry("GPS9", "?", body, 6, 2))
    np.testing.assert_array_equal(numbers(found, "lS"), [[-7, 9], [-7, 9]])
    with pytest.raises(ValueError, match="has 6 bytes"):
        numbers(found, "lL")
    with pytest.raises(ValueError, match="expected numbers"):
        numbers(found, "lF")
    (array,) = parse(structures("DATA", "fffL", [[1, 2, 3, 4]]))
    np.testing.assert_array_equal(numbers(array, "f[3]L"), [[1, 2, 3, 4]])


def test_samples_are_scaled_one_scale_for_all_or_one_each():
    scaled = telemetry(
        device(
            "Camera",
            stream(encode("GYRO", "s", [[100, 200, 300]]), encode("SCAL", "s", [[100]])),
            stream(encode("GPS5", "l", [[100, 200]]), encode("SCAL", "l", [[10], [100]])),
        )
    )
    assert scaled.device == "Camera"
    np.testing.assert_array_equal(scaled.sensors["GYRO"][0].samples, [[1, 2, 3]])
    np.testing.assert_array_equal(scaled.sensors["GPS5"][0].samples, [[10, 2]])


@pytest.mark.parametrize(
    "bad",
    [
        stream(encode("GPS5", "l", [[1, 2, 3]]), encode("SCAL", "l", [[10], [100]])),
        stream(encode("GPS5", "l", [[1, 2, 3]]), encode("SCAL", "l", [[0]])),
        nest("STRM", encode("GPS5", "l", [[1, 2, 3]])[:-4]),
    ],
)
def test_a_damaged_payload_is_counted_and_the_others_are_kept(bad):
    good = stream(encode("GYRO", "s", [[1, 2, 3]]))
    found = telemetry(device("Camera", good), device("Camera", bad, good), device("Camera", good))
    assert found.damaged == 1
    assert [block.start_s for block in found.sensors["GYRO"]] == [0.0, 2.0]


def test_text_and_unknown_types_are_left_out():
    found = telemetry(
        device("Camera", stream(text("NOTE", "hello")), stream(entry("DATE", "U", b"x" * 16, 16, 1)))
    )
    assert found.sensors == {} and found.damaged == 0


@pytest.mark.parametrize(
    "stamp", [entry("STMP", "J", b"", 8, 0), text("STMP", "noon"), entry("STMP", "", b"", 0, 0)]
)
def test_a_stamp_without_a_number_is_no_stamp(stamp):
    found = telemetry(device("Camera", stream(encode("GYRO", "s", [[1, 2, 3]]), stamp)))
    (block,) = found.sensors["GYRO"]
    assert np.isnan(block.stamp_s) and found.damaged == 0


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (encode("GPSF", "L", [[3], [2]]), 3.0),
        (encode("GPSF", "L", []), -1.0),
        (text("GPSF", "3D"), -1.0),
        (encode("GPSP", "L", [[7]]), -1.0),
    ],
)
def test_the_first_number_of_an_entry_or_the_default(said, expected):
    (found,) = parse(said)
    assert first_number({found.key: found}, "GPSF", -1.0) == expected


def test_a_file_that_is_not_a_video_is_refused(tmp_path):
    broken = tmp_path / "v.mp4"
    broken.write_bytes(b"\0\0\0\x18ftypmp42" + b"\0" * 40)
    with pytest.raises(RecordingError, match=r"v\.mp4: cannot be read"):
        read_gpmf(broken)


def test_a_video_of_another_camera_has_no_telemetry(recording):
    found = read_gpmf(recording / "video.mp4")
    assert found.sensors == {} and found.device == ""


def test_every_sensor_of_the_real_walk_is_found(data_dir):
    found = read_gpmf(data_dir / "gopro_walk/video.mp4")
    assert found.device == "GoPro Max" and found.damaged == 0
    assert {"ACCL", "GYRO", "SHUT", "GPS5", "GRAV"} <= set(found.sensors)
    assert sum(len(block.samples) for block in found.sensors["SHUT"]) == 316
    gravity = np.concatenate([block.samples for block in found.sensors["ACCL"]]).mean(axis=0)
    assert np.linalg.norm(gravity) == pytest.approx(9.8, abs=0.5)


@pytest.mark.parametrize("key", ["GPS5", "GYRO", "SHUT", "MAGN", "CORI", "WRGB"])
def test_gopros_own_parser_reads_the_same(data_dir, key):
    oracle = pytest.importorskip("py_gpmf_parser", reason="GoPro's own parser is the oracle; pip install it")
    video = data_dir / "gopro_walk/video.mp4"
    theirs = oracle.GoProTelemetryExtractor(str(video))
    theirs.open_source()
    values, times = theirs.extract_data(key)
    theirs.close_source()
    found = read_gpmf(video)
    ours = np.concatenate([block.samples for block in found.sensors[key]])
    if key == "GYRO":  # it turns XzY, the order of the file, to ORIO's ZXY; our reader to X, Y, Z
        gyro = read_gopro_gyro(found)
        assert gyro is not None
        ours = gyro.rate_rad_s[:, [2, 0, 1]]
    np.testing.assert_allclose(ours, values, rtol=1e-6, atol=1e-9)
    at = sample_times(found.sensors[key], found.sensors["SHUT"][0])
    # it lays the first stamp as we do, and spreads the others over their payloads
    assert at[0] == pytest.approx(times[0], abs=2e-3)
    np.testing.assert_allclose(at, times, atol=0.1)
