from pathlib import Path

import av
import numpy as np
import pytest
from clips import picture, write_clip
from nmea_text import gga, zda

from vgps.errors import CalibrationError, GpsLogError, RecordingError
from vgps.readers.recording import find_gps_logs, find_rig, open_recording

CAMERA = "model: pinhole\nwidth: 64\nheight: 48\nfx: 50\nfy: 50\ncx: 32\ncy: 24\n"
GYRO = "t_s,wx_rad_s,wy_rad_s,wz_rad_s\n5.0,0,0,0\n5.1,0,0,0\n"
CSV = "t_s,latitude_deg,longitude_deg,height_m,fix_class\n0.1,49,8,100,rtk_fix\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A recording of ten frames, with a camera."""
    root = tmp_path / "walk"
    root.mkdir()
    write_clip(root / "video.mp4")
    (root / "camera.yaml").write_text(CAMERA)
    return root


def test_a_whole_folder(folder):
    (folder / "rig.yaml").write_text("video_start_utc: 2011-09-26T12:00:00\nvideo_start_s: 5\n")
    (folder / "gps.log").write_text(gga("120000.25") + zda("120000.25", 26, 9, 2011))
    (folder / "gyro.csv").write_text(GYRO)
    (folder / "control_points.csv").write_text("frame,u_px,v_px,east_m,north_m,up_m\n9,1,2,3,4,5\n")
    recording = open_recording(folder)
    assert len(recording.video.times_s) == 10
    assert recording.camera.fx == 50
    np.testing.assert_allclose(recording.gps.t_s, [0.25], atol=1e-6)
    np.testing.assert_allclose(recording.gyro.t_s, [0, 0.1], atol=1e-9)
    assert recording.control_points.frame.tolist() == [9]


def test_what_may_move_every_pose_is_noted_beside_the_recording(folder):
    (folder / "rig.yaml").write_text("video_start_utc: 2011-09-26T12:00:00\n")
    point = '<trkpt lat="49" lon="8"><ele>100</ele><time>2011-09-26T12:00:00.5Z</time></trkpt>'
    (folder / "gps.gpx").write_text(f'<gpx version="1.1"><trk><trkseg>{point}</trkseg></trk></gpx>')
    (note,) = open_recording(folder).notes
    assert note.startswith("gps.gpx: heights without geoidheight")


def test_a_calibrated_gyro_is_on_the_videos_clock_and_without_bias(folder):
    (folder / "gyro.csv").write_text(GYRO)
    (folder / "rig.yaml").write_text(
        "video_start_s: 5\ngyro_time_offset_s: 0.03\ngyro_bias_rad_s: [0.01, 0, -0.02]\n"
    )
    gyro = open_recording(folder).gyro
    np.testing.assert_allclose(gyro.t_s, [0.03, 0.13], atol=1e-9)
    np.testing.assert_allclose(gyro.rate_rad_s, [[-0.01, 0, 0.02]] * 2, atol=1e-12)


def test_the_rig_that_is_read(folder):
    assert find_rig(folder) is None
    (folder / "rig.yaml").write_text("")
    (folder / "mount.yaml").write_text("")
    assert find_rig(folder / "video.mp4") == folder / "rig.yaml"
    assert find_rig(folder, "mount.yaml") == folder / "mount.yaml"
    with pytest.raises(RecordingError, match=r"none\.yaml: no such file"):
        find_rig(folder, "none.yaml")


def test_the_rig_is_found_without_opening_the_video(folder):
    (folder / "video.mp4").write_bytes(b"no video")
    (folder / "rig.yaml").write_text("")
    assert find_rig(folder) == folder / "rig.yaml"


def test_a_video_and_a_camera_are_enough(folder):
    for recording in (open_recording(folder), open_recording(str(folder / "video.mp4"))):
        assert (recording.gps, recording.gyro, recording.control_points) == (None, None, None)
        assert recording.rig.video_start_utc is None


def test_files_named_by_path_or_inside_the_folder(folder, tmp_path):
    (folder / "gps_a.csv").write_text(CSV)
    (folder / "gps_b.csv").write_text(CSV.replace("rtk_fix", "single"))
    other = tmp_path / "other.csv"
    other.write_text(CSV.replace("rtk_fix", "dgps"))
    (tmp_path / "lens.yaml").write_text(CAMERA.replace("fx: 50", "fx: 51"))
    (tmp_path / "mount.yaml").write_text("exposure_s: 0.02\n")
    assert open_recording(folder, gps="gps_b.csv").gps.fix_class == ("single",)
    recording = open_recording(folder, gps=other, camera=tmp_path / "lens.yaml", rig=tmp_path / "mount.yaml")
    assert recording.gps.fix_class == ("dgps",)
    assert recording.camera.fx == 51
    assert recording.rig.exposure_s == 0.02


def test_several_logs_need_a_name(folder):
    for name in ("gps_a.csv", "gps_b.csv"):
        (folder / name).write_text(CSV)
    (folder / "gps_truth.json").write_text("{}")
    with pytest.raises(
        GpsLogError, match=r"several GPS logs: gps_a\.csv, gps_b\.csv; name one: --gps gps_a\.csv"
    ):
        open_recording(folder)
    with pytest.raises(RecordingError, match=r"gps_c\.csv: no such file; give a path, or a name inside"):
        open_recording(folder, gps="gps_c.csv")


def test_a_log_named_gps_must_be_readable(folder):
    (folder / "gps.txt").write_text("hello\n")
    with pytest.raises(GpsLogError, match=r"gps\.txt: not a GPS log of a known format"):
        open_recording(folder)


def test_a_log_of_another_day_is_refused(folder):
    (folder / "rig.yaml").write_text("video_start_utc: 2011-09-26T12:00:00\n")
    (folder / "gps.nmea").write_text(gga("120000.25") + zda("120000.25", 27, 9, 2011))
    with pytest.raises(GpsLogError, match=r"2011-09-27 12:00:00 .* 2011-09-26 12:00:00"):
        open_recording(folder)


def test_images_in_a_folder_of_their_own_or_directly(folder):
    (folder / "video.mp4").unlink()
    images = folder / "images"
    images.mkdir()
    for index in range(3):
        av.VideoFrame.from_ndarray(picture(index), "rgb24").save(str(images / f"{index}.png"))
    (folder / "frame_times.csv").write_text("frame,t_s\n0,5\n1,5.5\n2,6\n")
    (folder / "gyro.csv").write_text(GYRO)
    recording = open_recording(folder)
    assert recording.video.times_s.tolist() == [0, 0.5, 1]
    # gyro.csv is on the clock of frame_times.csv
    np.testing.assert_allclose(recording.gyro.t_s, [0, 0.1], atol=1e-9)
    assert recording.rig.video_start_s == 5
    assert open_recording(images).camera == recording.camera
    for file in images.iterdir():
        file.rename(folder / file.name)
    images.rmdir()
    assert len(open_recording(folder).video.times_s) == 3


def test_frame_times_beside_a_video(folder):
    (folder / "frame_times.csv").write_text("frame,t_s\n" + "".join(f"{i},{i * 0.25}\n" for i in range(10)))
    assert open_recording(folder).video.times_s[-1] == 2.25


def test_missing_files_are_named(folder, tmp_path):
    with pytest.raises(RecordingError, match="no such recording; expected a folder"):
        open_recording(tmp_path / "none")
    (folder / "video.mov").write_bytes((folder / "video.mp4").read_bytes())
    with pytest.raises(RecordingError, match=r"several videos: video\.mp4, video\.mov; name one"):
        open_recording(folder)
    (folder / "camera.yaml").unlink()
    with pytest.raises(RecordingError, match=r"no camera\.yaml; give a calibration with --camera"):
        open_recording(folder / "video.mov", guess_camera=False)
    assert open_recording(folder / "video.mov").guesses
    with pytest.raises(RecordingError, match=r"no video; expected video\.mp4"):
        open_recording(tmp_path)


def test_a_camera_of_another_size_is_refused_with_both(folder):
    (folder / "camera.yaml").write_text(CAMERA.replace("64", "128"))
    with pytest.raises(CalibrationError, match=r"a camera of 128 x 48; expected 64 x 48 as in .*video\.mp4"):
        open_recording(folder)


def test_a_control_point_beyond_the_video_is_refused(folder):
    (folder / "control_points.csv").write_text("frame,u_px,v_px,east_m,north_m,up_m\n10,1,2,3,4,5\n")
    with pytest.raises(RecordingError, match="frame 10; expected frames 0 to 9"):
        open_recording(folder)


@pytest.mark.slow
def test_real_recordings_open_with_their_logs(data_dir):
    names = [log.name for log in find_gps_logs(data_dir / "kitti03")]
    assert names == [f"gps_{kind}.nmea" for kind in ("fix", "float", "float_b", "late", "outliers")]
    recording = open_recording(data_dir / "kitti03", gps="gps_float.nmea")
    np.testing.assert_allclose(recording.gps.t_s, np.arange(80) + 0.03, atol=1e-6)
    phone = open_recording(data_dir / "phone_gyro")
    assert phone.video.times_s[1] == 0.033312
    assert len(phone.gyro.t_s) == 1812
