import numpy as np
import pytest
import yaml

from vgps.errors import CalibrationError, RunFolderError
from vgps.readers.calibration.rig_file import read_rig
from vgps.writers.rig import write_rig

QUARTER = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
BASE = "# a comment\ncamera_p_antenna: [0.1, -0.6, 0.3]\nvideo_start_utc: 2026-05-01T09:30:12.5+00:00\n"


def test_what_is_written_is_read_again(tmp_path):
    out = tmp_path / "rig.yaml"
    fields = {"gyro_R_camera": QUARTER, "gyro_time_offset_s": 0.02, "gyro_bias_rad_s": [0.001, 0.0, -2e-6]}
    write_rig({**fields, "gyro_rotation_sigma_deg": [0.1, 0.2, 0.3]}, out)
    rig = read_rig(out)
    np.testing.assert_array_equal(rig.gyro_R_camera, QUARTER)
    assert rig.gyro_time_offset_s == 0.02
    np.testing.assert_array_equal(rig.gyro_bias_rad_s, [0.001, 0.0, -2e-6])


def test_the_other_keys_keep_their_values_and_order(tmp_path):
    base, out = tmp_path / "rig.yaml", tmp_path / "new.yaml"
    base.write_text(BASE + "gyro_time_offset_s: 9\nexposure_s: 0.01\n")
    write_rig({"gyro_time_offset_s": 0.02, "gyro_R_camera": QUARTER}, out, base=base)
    keys = list(yaml.safe_load(out.read_text()))
    assert keys == [
        "camera_p_antenna",
        "video_start_utc",
        "gyro_time_offset_s",
        "exposure_s",
        "gyro_R_camera",
    ]
    old, new = read_rig(base), read_rig(out)
    np.testing.assert_array_equal(new.camera_p_antenna, old.camera_p_antenna)
    assert new.video_start_utc == old.video_start_utc and new.exposure_s == 0.01
    assert (old.gyro_time_offset_s, new.gyro_time_offset_s) == (9, 0.02)


def test_base_and_out_may_be_one_file_and_twice_is_once(tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text(BASE)
    write_rig({"gyro_R_camera": QUARTER}, rig, base=rig)
    once = rig.read_bytes()
    write_rig({"gyro_R_camera": QUARTER}, rig, base=rig)
    assert rig.read_bytes() == once
    assert [file.name for file in tmp_path.iterdir()] == ["rig.yaml"]


def test_what_is_no_rig_is_not_written(tmp_path):
    out = tmp_path / "rig.yaml"
    out.write_text(BASE)
    for wrong in ({"gyro_R_camera": [[1, 0, 0]] * 3}, {"gyro_colour": 3}):
        with pytest.raises(CalibrationError):
            write_rig(wrong, out, base=out)
        assert out.read_text() == BASE and len(list(tmp_path.iterdir())) == 1


def test_a_base_that_is_no_rig_is_refused_by_its_name(tmp_path):
    base = tmp_path / "base.yaml"
    base.write_text("camera_p_antena: [0, 0, 0]\n")
    with pytest.raises(CalibrationError, match=r"base\.yaml.*camera_p_antena"):
        write_rig({}, tmp_path / "rig.yaml", base=base)
    assert not (tmp_path / "rig.yaml").exists()


def test_a_place_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError):
        write_rig({"gyro_R_camera": QUARTER}, tmp_path / "file" / "rig.yaml")
    with pytest.raises(RunFolderError):
        write_rig({"gyro_R_camera": QUARTER}, tmp_path)
