from dataclasses import replace
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml

from vgps.errors import ConfigError, RunFolderError
from vgps.model import FixClass
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, AccelerometerConfig, Renderer, SceneConfig, simulate
from vgps.simulate.recording import FILES

TINY = replace(
    SCENES["demo"],
    speed=((0.0, 1.2), (2.0, 1.2)),
    width=320,
    height=240,
    focal_px=280.0,
    texture_scale=0.3,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("simulated") / "tiny"
    simulate(out, TINY, seed=3)
    return out


def gray_frames(folder: Path) -> list[np.ndarray]:
    with av.open(folder / "video.mp4") as container:
        return [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]


@pytest.mark.slow
def test_the_folder_holds_a_recording(folder: Path) -> None:
    assert {entry.name for entry in folder.iterdir()} == set(FILES)
    recording = open_recording(folder)
    assert (recording.camera.width, recording.camera.height, recording.camera.fx) == (320, 240, 280.0)
    assert (recording.camera.cx, recording.camera.cy) == (159.5, 119.5)
    np.testing.assert_allclose(recording.rig.camera_p_antenna, TINY.camera_p_antenna)
    assert recording.rig.exposure_s == TINY.exposure_s
    assert recording.rig.world_origin == TINY.world_origin
    assert recording.gps is not None and recording.gps.fix_class == (FixClass.RTK_FIX, FixClass.RTK_FLOAT)
    np.testing.assert_allclose(recording.gps.t_s, [0.03, 1.03], atol=1e-6)
    assert recording.gyro is not None
    assert recording.gyro.t_s[0] <= -0.19 and recording.gyro.t_s[-1] >= 1.93 + 0.19


@pytest.mark.slow
def test_other_cameras_look_outwards_from_a_ring(tmp_path: Path) -> None:
    short = replace(TINY, speed=((0.0, 1.2), (0.2, 1.2)), cameras=3)
    for _ in range(2):  # the second replaces the first
        simulate(tmp_path / "rig", short)
    recording = open_recording(tmp_path / "rig")
    assert [camera.name for camera in recording.cameras] == ["camera_2", "camera_3"]
    centre = np.array([0.0, 0.0, -0.1])  # of the ring
    for camera, angle_deg in zip(recording.cameras, (120.0, 240.0), strict=True):
        outwards = camera.reference_T_camera[:3, 2]
        np.testing.assert_allclose(camera.reference_T_camera[:3, 3], centre + 0.1 * outwards, atol=1e-9)
        assert outwards[2] == pytest.approx(np.cos(np.radians(angle_deg)))
        assert len(camera.video.times_s) == short.frames
        assert all(frame.gray.std() > 10.0 for frame in camera.video.frames())


@pytest.mark.slow
def test_an_imu_comes_with_its_mounting(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "imu"
    for seconds in (0.2, 2.0):  # the second replaces the first
        scene = replace(TINY, speed=((0.0, 1.2), (seconds, 1.2)), accelerometer=AccelerometerConfig())
        simulate(out, scene, seed=3)
    recording, without = open_recording(out), open_recording(folder)
    assert recording.imu is not None and recording.rig.imu is not None and without.gyro is not None
    np.testing.assert_allclose(recording.imu.rate_rad_s, without.gyro.rate_rad_s, rtol=0.05, atol=0.02)
    assert (out / "gyro.csv").read_bytes() != (folder / "gyro.csv").read_bytes()  # its scales are off
    up = recording.imu.force_m_s2 @ recording.rig.imu.imu_R_camera
    assert up[:, 1].mean() == pytest.approx(-9.8, abs=0.4)  # the camera's y axis points down
    assert (out / "video.mp4").read_bytes() == (folder / "video.mp4").read_bytes()
    biases = np.loadtxt(out / "imu_biases.csv", delimiter=",", skiprows=1)
    assert np.diff(biases[:, 0]) == pytest.approx(0.1)
    assert 0.0 < np.abs(biases[:, 1:4]).max() < 0.05 < np.abs(biases[:, 4:]).max() < 0.5


@pytest.mark.slow
def test_frames_come_at_exactly_the_times_of_the_truth(folder: Path) -> None:
    with av.open(folder / "video.mp4") as container:
        times = [float(frame.pts * frame.time_base) for frame in container.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(30) / 15, atol=1e-9)
    np.testing.assert_allclose(read_trajectory(folder / "truth.tum").t_s, times, atol=1e-8)


@pytest.mark.slow
def test_tracked_corners_agree_with_the_truth(folder: Path) -> None:
    camera = yaml.safe_load((folder / "camera.yaml").read_text())
    K = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    poses = read_trajectory(folder / "truth.tum").world_T_camera
    frames = gray_frames(folder)
    first = 10
    corners = cv2.goodFeaturesToTrack(frames[first], 200, 0.01, 8)
    tracks, kept = [corners[:, 0]], np.ones(len(corners), bool)
    for k in range(first, first + 10):
        now = tracks[-1].reshape(-1, 1, 2)
        ahead, found, _ = cv2.calcOpticalFlowPyrLK(frames[k], frames[k + 1], now, None, winSize=(15, 15))
        back, _, _ = cv2.calcOpticalFlowPyrLK(frames[k + 1], frames[k], ahead, None, winSize=(15, 15))
        kept &= (found[:, 0] > 0) & (np.linalg.norm(now - back, axis=-1)[:, 0] < 0.5)
        tracks.append(ahead[:, 0])
    assert kept.sum() > 80
    P = K @ np.linalg.inv(poses[first : first + 11])[:, :3]
    error = [reprojection_error(P, track) for track in np.stack(tracks, axis=1)[kept]]
    assert np.median(error) < 0.2
    wrong = K @ np.linalg.inv(poses[[first] * 11])[:, :3]  # a camera that stands still does not explain them
    wrong[:, :, 3] += np.arange(11)[:, None] * 1e-6
    assert np.median([reprojection_error(wrong, t) for t in np.stack(tracks, axis=1)[kept]]) > 1.0


def reprojection_error(P: np.ndarray, uv: np.ndarray) -> float:
    """Root mean square distance of a track to the best point under given projections."""
    rows = np.concatenate([uv[:, :1] * P[:, 2] - P[:, 0], uv[:, 1:] * P[:, 2] - P[:, 1]])
    point = np.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True))[2][-1]
    seen = P @ point
    return float(np.sqrt(np.mean(np.sum((seen[:, :2] / seen[:, 2:] - uv) ** 2, axis=1))))


@pytest.mark.slow
def test_fix_errors_are_logged(folder: Path) -> None:
    lines = (folder / "fix_errors.csv").read_text().splitlines()
    assert lines[0] == "t_s,fix_class,east_m,north_m,up_m,outlier"
    assert [line.split(",")[:2] for line in lines[1:]] == [["0.03", "rtk_fix"], ["1.03", "rtk_float"]]


@pytest.mark.slow
def test_same_seed_same_bytes_other_seed_other_world(folder: Path, tmp_path: Path) -> None:
    short = replace(TINY, speed=((0.0, 1.2), (0.5, 1.2)))
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        simulate(tmp_path / name, short, seed=seed)
    for file in FILES:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file
    for file in ("video.mp4", "gps.nmea", "gyro.csv", "truth.tum"):
        assert (tmp_path / "a" / file).read_bytes() != (tmp_path / "c" / file).read_bytes(), file


@pytest.mark.slow
def test_another_pass_shakes_differently_in_the_same_world(tmp_path: Path) -> None:
    short = replace(TINY, speed=((0.0, 1.2), (0.2, 1.2)), hand_shake=1.0)
    for name, own in (("first", None), ("second", 5)):
        simulate(tmp_path / name, replace(short, pass_seed=own), seed=3)
    first, second = tmp_path / "first", tmp_path / "second"
    for file in ("gyro.csv", "truth.tum", "fix_errors.csv"):
        assert (first / file).read_bytes() != (second / file).read_bytes(), file
    # the same house and ground at nearly the same place
    pictures = [gray_frames(folder)[0][:240].astype(float).ravel() for folder in (first, second)]
    simulate(tmp_path / "elsewhere", short, seed=4)
    elsewhere = gray_frames(tmp_path / "elsewhere")[0][:240].astype(float).ravel()
    assert np.corrcoef(*pictures)[0, 1] > 0.6 > np.corrcoef(pictures[0], elsewhere)[0, 1]


@pytest.mark.slow
def test_moving_things_change_the_picture_and_not_the_truth(tmp_path: Path) -> None:
    short = replace(TINY, speed=((0.0, 1.2), (0.5, 1.2)))
    simulate(tmp_path / "still", short)
    simulate(tmp_path / "moving", replace(short, moving=True))
    still, moving = (gray_frames(tmp_path / name)[4].astype(int) for name in ("still", "moving"))
    assert 50 < (np.abs(still - moving) > 25).sum() < still.size / 2
    assert (tmp_path / "still/truth.tum").read_bytes() == (tmp_path / "moving/truth.tum").read_bytes()


class StopError(Exception):
    pass


def stop_at_second(_: Renderer, index: int) -> np.ndarray:
    if index == 1:
        raise StopError
    return np.zeros((TINY.height, TINY.width, 3), np.uint8)


@pytest.mark.slow
def test_a_simulation_cut_short_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Renderer, "frame", stop_at_second)
    with pytest.raises(StopError):
        simulate(tmp_path / "out", TINY)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_earlier_simulation_stays_until_the_new_one_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tiny = replace(TINY, speed=((0.0, 1.2), (0.2, 1.2)))
    simulate(tmp_path / "out", tiny)
    before = (tmp_path / "out/truth.tum").read_bytes()
    with monkeypatch.context() as patch, pytest.raises(StopError):
        patch.setattr(Renderer, "frame", stop_at_second)
        simulate(tmp_path / "out", TINY, seed=1)
    assert (tmp_path / "out/truth.tum").read_bytes() == before
    for name in (
        "mine.txt",
        "imu.csv",
        "camera_2.mp4",
    ):  # the last two as of a simulation with IMU and cameras
        (tmp_path / "out" / name).touch()
    simulate(tmp_path / "out", tiny, seed=1)
    assert (tmp_path / "out/truth.tum").read_bytes() != before
    assert {entry.name for entry in (tmp_path / "out").iterdir()} == {*FILES, "mine.txt"}
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("names", [["notes.txt"], ["video.mp4", "camera.yaml"]])
def test_folders_of_others_are_not_overwritten(tmp_path: Path, names: list[str]) -> None:
    for name in names:
        (tmp_path / name).write_text("kept")
    with pytest.raises(RunFolderError, match="nothing was overwritten"):
        simulate(tmp_path, TINY)
    assert {entry.name: entry.read_text() for entry in tmp_path.iterdir()} == dict.fromkeys(names, "kept")


def test_an_existing_file_and_an_unknown_scene_are_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(RunFolderError, match="is a file"):
        simulate(tmp_path / "out", TINY)
    with pytest.raises(RunFolderError):
        simulate(tmp_path / "out" / "below", TINY)
    with pytest.raises(ConfigError, match="walk, drive, demo, spin, drone, orbit"):
        simulate(tmp_path / "new", "moon")
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SCENES))
def test_every_scene_renders_textured_frames(name: str) -> None:
    config: SceneConfig = replace(SCENES[name], texture_scale=0.5, max_samples=4)
    from vgps.simulate import Renderer, build_motion, build_world

    renderer = Renderer(
        build_world(config, np.random.default_rng(0)), build_motion(config, np.random.default_rng(1)), config
    )
    for index in np.linspace(0, config.frames - 1, 4).astype(int):
        gray = cv2.cvtColor(renderer.frame(int(index)), cv2.COLOR_BGR2GRAY)
        corners = cv2.goodFeaturesToTrack(gray, 500, 0.01, 10)
        cells = {(int(u * 4 / config.width), int(v * 4 / config.height)) for u, v in corners[:, 0]}
        assert len(corners) > 100 and len(cells) >= 6
