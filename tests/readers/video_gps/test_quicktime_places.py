import numpy as np
import pytest
from metadata_videos import box, write_metadata_video, write_timed_metadata_video

from vgps.readers.recording import open_recording
from vgps.readers.video_gps.quicktime_places import read_quicktime_places

PLACE, ACCURACY = "com.apple.quicktime.location.ISO6709", "com.apple.quicktime.location.accuracy.horizontal"
KEYS = {"com.apple.quicktime.video-orientation": b"\0\0\0\1", PLACE: b"\0\0\0\2", ACCURACY: b"\0\0\0\3"}


def place(text, accuracy=None):
    stated = b"" if accuracy is None else box(KEYS[ACCURACY], accuracy.encode())
    return box(b"\0\0\0\1", b"\0\1") + box(KEYS[PLACE], text.encode()) + stated


def fixes_of(path, *packets, keys=KEYS):
    timed = [(0.2 * index, data) for index, data in enumerate(packets)]
    return read_quicktime_places(write_timed_metadata_video(path / "IMG.mp4", timed, keys))


def test_places_with_their_accuracies(tmp_path):
    timed = [(0.1, place("+47.5000+008.2500+500.000/", "4.0")), (0.6, place("+47.6000-008.2500+501.5/"))]
    opened = open_recording(write_timed_metadata_video(tmp_path / "IMG_0001.mp4", timed, KEYS))
    assert opened.gps is not None
    np.testing.assert_allclose(opened.gps.t_s, [0.1, 0.6])
    np.testing.assert_allclose(opened.gps.latitude_deg, [47.5, 47.6])
    np.testing.assert_allclose(opened.gps.longitude_deg, [8.25, -8.25])
    above_ellipsoid_m = opened.gps.height_m - [500.0, 501.5]
    assert ((above_ellipsoid_m > 40.0) & (above_ellipsoid_m < 60.0)).all()  # the geoid of Europe
    assert opened.gps.sigma_m[0, 0] == pytest.approx(4.0 / np.sqrt(2.0)) and np.isnan(
        opened.gps.sigma_m[1, 0]
    )


@pytest.mark.parametrize(
    ("text", "latitude_deg", "longitude_deg"),
    [
        ("+47-008/", 47.0, -8.0),
        ("-4730.6+00815.3+1CRSWGS_84/", -47.51, 8.255),
        ("+473036.0-0081518.0", 47.51, -8.255),
    ],
)
def test_degrees_minutes_and_seconds(tmp_path, text, latitude_deg, longitude_deg):
    raw = fixes_of(tmp_path, place(text))
    assert raw is not None
    assert raw.fixes[0][1:3] == pytest.approx((latitude_deg, longitude_deg))


def test_what_is_no_place_is_counted(tmp_path):
    damaged = (
        place("somewhere"),
        place(""),
        place("+475+008.25/"),
        box(KEYS[PLACE], b"\xff\xfe"),
        b"\0\0\0\x20\0\0\0\2cut off",
    )
    raw = fixes_of(tmp_path, *damaged, place("+47.5+008.25/"))
    assert raw is not None and len(raw.fixes) == 1
    assert raw.fixes[0].height_m == 0.0 and raw.fixes[0].sigma_m[2] > 100.0
    assert raw.notes[-1] == "4 places not written as in ISO 6709 skipped"


def test_tracks_of_other_keys_hold_no_fixes(tmp_path):
    faces = {"com.apple.quicktime.detected-face": b"\0\0\0\1"}
    assert fixes_of(tmp_path, place("+47.5+008.25/"), keys=faces) is None
    written = write_metadata_video(tmp_path / "none.mp4", [(0.0, place("+47.5+008.25/"))], "mebx")
    assert read_quicktime_places(written) is None
