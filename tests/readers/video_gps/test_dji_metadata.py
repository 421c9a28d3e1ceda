import contextlib
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from metadata_videos import write_metadata_video

from vgps.crs import egm96
from vgps.readers.calibration.camera_guess import guess_cameras
from vgps.readers.recording import open_recording
from vgps.readers.sources import open_video, telemetry_of
from vgps.readers.video_gps.dji_metadata import parse, position, read_dji_metadata


def varint(value: int) -> bytes:
    value %= 1 << 64
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def field(number: int, value: int | float | bytes) -> bytes:
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, float):
        return varint(number << 3 | 1) + struct.pack("<d", value)
    return varint(number << 3 | 2) + varint(len(value)) + value


def nested(path, data: bytes) -> bytes:
    for number in reversed(path):
        data = field(number, data)
    return data


def message(latitude: float, longitude: float, height_mm: int, path=(3, 3, 4), units: bytes = b"") -> bytes:
    place = units + field(2, latitude) + field(3, longitude)
    return nested(path, field(1, place) + field(2, height_mm))


def header(protocol: str) -> bytes:
    return field(1, field(1, field(1, protocol.encode()) + field(10, b"DJI Mini4 Pro")))


def test_the_wire_format_by_hand():
    # the examples of protobuf.dev: field 1 is 150, field 2 is "testing"; then 64 and 32 bits
    data = b"\x08\x96\x01" + b"\x12\x07testing" + b"\x19" + struct.pack("<d", 2.5) + b"\x25abcd"
    assert parse(data) == {1: 150, 2: b"testing", 3: 2.5, 4: b"abcd"}


@pytest.mark.parametrize("data", [b"\x08", b"\x12\x05ab", b"\x19abc", b"\x0b", b"\x08" + b"\xff" * 11])
def test_damaged_messages_are_refused(data):
    with pytest.raises(ValueError, match=r"field|number"):
        parse(data)


@given(st.binary(max_size=60), st.sampled_from([(), (3,), (3, 3), (3, 3, 4), (3, 3, 4, 1), (3, 4, 2)]))
def test_any_bytes_are_a_message_or_refused(data, path):
    with contextlib.suppress(ValueError):
        position(parse(nested(path, data)))


@pytest.mark.filterwarnings("error")
@given(st.floats(), st.floats(), st.integers(0, 2**64 - 1))
def test_any_numbers_are_a_position_or_none_without_a_warning(latitude, longitude, height_mm):
    found = position(parse(message(latitude, longitude, height_mm)))
    assert found is None or abs(found[2]) <= 2**63 / 1000


@pytest.mark.parametrize("path", [(3, 3, 4), (3, 4, 4), (3, 4, 2)])
def test_positions_of_all_layouts(path):
    radians = np.radians([47.5, -8.25]).tolist()
    assert position(parse(message(*radians, 612_345, path))) == pytest.approx((47.5, -8.25, 612.345))
    degrees = message(47.5, -8.25, -2_500, path, units=field(1, 1))
    assert position(parse(degrees)) == pytest.approx((47.5, -8.25, -2.5))
    assert position(parse(message(47.5, -8.25, 0, path)), in_degrees=True) == (47.5, -8.25, 0.0)


def test_messages_without_a_fix():
    assert position(parse(message(0.0, 0.0, 1000))) is None
    assert position(parse(header("dvtm_Mini4_Pro.proto"))) is None


def test_a_drones_video_has_its_fixes_and_its_lens(tmp_path):
    place = np.radians([[47.5, 8.25], [47.5, 8.25], [47.50001, 8.25]]).tolist()
    messages = [message(*one, 500_000) for one in place]
    packets = [(0.0, header("dvtm_Mini4_Pro.proto") + messages[0]), (0.1, messages[1]), (0.2, messages[2])]
    file = write_metadata_video(tmp_path / "DJI_0001.MP4", [*packets, (0.3, b"\x12\x05ab")], "djmd")
    fixes = open_recording(file).gps
    assert fixes is not None
    np.testing.assert_allclose(fixes.t_s, [0.0, 0.2])
    np.testing.assert_allclose(fixes.latitude_deg, [47.5, 47.50001], atol=1e-12)
    np.testing.assert_allclose(fixes.height_m, 500.0 + egm96().height_m(fixes.latitude_deg, 8.25))
    assert any("damaged packet" in note for note in fixes.skipped)
    assert any("repeated position" in note for note in fixes.skipped)
    video = open_video(file)
    guess, *_ = guess_cameras(video, telemetry_of(video))
    assert "DJI drones" in guess.source


@pytest.mark.parametrize("protocol", ["dvtm_ac203.proto", "dvtm_AVATA2.proto", "dvtm_dji_neo.proto"])
def test_wide_cameras_have_no_usual_drones_lens(tmp_path, protocol):
    first = nested((1, 1, 1), protocol.encode()) + message(0.8, 0.1, 500_000, (3, 4, 2))
    (tmp_path / "DJI_0001.SRT").write_text("1\n00:00:00,000 --> 00:00:00,033\n[iso: 100] [latitude: 48.1]\n")
    video = open_video(write_metadata_video(tmp_path / "DJI_0001.MP4", [(0.0, first)], "djmd"))
    assert [guess.camera.model for guess in guess_cameras(video, telemetry_of(video))] == [
        "opencv",
        "fisheye",
    ]


def test_a_newer_protocol_states_degrees_without_a_word(tmp_path):
    first = header("dvtm_Mavic4.proto") + message(0.8, 0.1, 500_000)
    raw = read_dji_metadata(write_metadata_video(tmp_path / "DJI_0001.MP4", [(0.0, first)], "djmd"))
    assert raw is not None and raw.fixes[0].latitude_deg == 0.8


@pytest.mark.parametrize("protocol, flies", [("dvtm_ac203.proto", False), ("dvtm_AVATA2.proto", True)])
def test_drones_fly_and_action_cameras_do_not(tmp_path, protocol, flies):
    first = nested((1, 1, 1), protocol.encode()) + message(0.8, 0.1, 500_000)
    raw = read_dji_metadata(write_metadata_video(tmp_path / "DJI_0001.MP4", [(0.0, first)], "djmd"))
    assert raw is not None and raw.airborne == flies


def test_other_videos_have_no_such_track(recording):
    assert read_dji_metadata(recording / "video.mp4") is None
