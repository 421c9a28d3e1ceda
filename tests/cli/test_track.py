"""`vgps track` as a user calls it: a folder of images, a gyro, and a database on disk."""

import cv2
import numpy as np
import pytest
import yaml
from textured_wall import CAMERA, GYRO_R_CAMERA, ORIGIN, WallDatabase, WallVideo, gyro, pose_at

from vgps.camera import camera_fields
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.model import DatabaseContents, LandmarkViews, Source
from vgps.readers.trajectory import read_trajectory

VIDEO = WallVideo(8)


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    wall = WallDatabase()
    views = LandmarkViews(**wall.all_views)
    path = tmp_path_factory.mktemp("wall") / "wall.db"
    write_database(
        DatabaseContents(ORIGIN, views, wall.keyframes(), (Source("wall", "all", len(views), "{}"),)),
        path,
    )
    return path


@pytest.fixture
def recording(tmp_path):
    folder = tmp_path / "wall"
    (folder / "images").mkdir(parents=True)
    for frame in VIDEO.frames():
        cv2.imwrite(str(folder / "images" / f"{frame.index:03}.png"), frame.gray)
    times = "".join(f"{i},{t}\n" for i, t in enumerate(VIDEO.times_s))
    (folder / "images" / "frame_times.csv").write_text(f"frame,t_s\n{times}")
    (folder / "camera.yaml").write_text(yaml.safe_dump(camera_fields(CAMERA)))
    rig = {"gyro_R_camera": GYRO_R_CAMERA.tolist(), "exposure_s": VIDEO.exposure_s}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    log = gyro(0.8)
    table = np.column_stack([log.t_s, log.rate_rad_s])
    head = "t_s,wx_rad_s,wy_rad_s,wz_rad_s"
    np.savetxt(folder / "gyro.csv", table, "%.6f", ",", header=head, comments="")
    return folder


@pytest.mark.slow
def test_track_writes_a_run(recording, database, tmp_path, vgps_verb):
    out = tmp_path / "run"
    code, said, error = vgps_verb("track", recording, "--landmarks", database, "--out", out)
    assert (code, error) == (0, "")
    assert "8 of 8 frames tracked" in said
    poses = read_trajectory(out / "poses.tum")
    true = np.array([pose_at(t) for t in poses.t_s])
    assert np.linalg.norm(poses.world_T_camera[:, :3, 3] - true[:, :3, 3], axis=1).max() < 0.1


@pytest.mark.slow
def test_a_missing_gyro_is_reported(recording, database, tmp_path, vgps_verb):
    (recording / "gyro.csv").unlink()
    words = ("track", recording, "--landmarks", database, "--out", tmp_path / "run", "--estimator", "frame")
    code, said, _ = vgps_verb(*words)
    assert code == 0
    assert "note: no gyro: rotation is predicted at constant angular velocity" in said
    assert "estimator: frame" in (tmp_path / "run" / "config.yaml").read_text()


def give_imu(recording, name):
    """Write the gyro's rates and a specific force as an IMU's log; the other gyro goes."""
    (recording / "gyro.csv").unlink()
    log = gyro(0.8)
    table = np.column_stack([log.t_s, log.rate_rad_s, np.tile([0.0, 0.0, 9.81], (len(log.t_s), 1))])
    head = "t_s,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2"
    np.savetxt(recording / name, table, "%.6f", ",", header=head, comments="")


@pytest.mark.slow
def test_a_named_imu_serves_as_the_gyro(recording, database, tmp_path, vgps_verb):
    give_imu(recording, "other.csv")
    rig = {"imu_R_camera": GYRO_R_CAMERA.tolist(), "exposure_s": VIDEO.exposure_s}
    (recording / "mounted.yaml").write_text(yaml.safe_dump(rig))
    words = ("track", recording, "--landmarks", database, "--out", tmp_path / "run")
    code, said, _ = vgps_verb(*words, "--imu", "other.csv", "--rig", "mounted.yaml")
    assert code == 0 and "8 of 8 frames tracked" in said and "no gyro" not in said


@pytest.mark.slow
def test_an_imu_without_its_mounting_is_left_out_with_a_warning(recording, database, tmp_path, vgps_verb):
    give_imu(recording, "imu.csv")
    code, said, _ = vgps_verb("track", recording, "--landmarks", database, "--out", tmp_path / "run")
    assert code == 0
    assert "note: imu.csv is left out: rig.yaml has no imu_R_camera" in said and "no gyro" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("config", "said"),
    [
        ("localization: {max_landmark: 3}\n", "did you mean localization.max_landmarks?"),
        ("localization: {blur: some}\n", "key localization.blur: found 'some'"),
        ("localization: {selection: {octaves: 1}}\n", "key localization.selection.octaves: unknown key"),
    ],
)
def test_a_bad_setting_is_one_line(recording, database, tmp_path, vgps_verb, config, said):
    file = tmp_path / "track.yaml"
    file.write_text(config)
    words = ("track", recording, "--landmarks", database, "--out", tmp_path / "run", "--config", file)
    code, _, error = vgps_verb(*words)
    assert code == 2
    assert error.count("\n") == 1
    assert said in error
    assert not (tmp_path / "run").exists()


def test_no_database_is_one_line(recording, tmp_path, vgps_verb):
    words = ("track", recording, "--landmarks", tmp_path / "none.db", "--out", tmp_path / "run")
    code, _, error = vgps_verb(*words)
    assert code == 2
    assert error.count("\n") == 1
    assert "none.db" in error
