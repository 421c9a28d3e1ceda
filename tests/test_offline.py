from dataclasses import replace
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

import vgps
from vgps.evaluate import evaluate
from vgps.readers.trajectory import read_trajectory
from vgps.solution import FrameState
from vgps.writers.run_folder import write_run


def truth_of(recording: Path):
    return read_trajectory(recording / "truth.tum")


def errors(solution, recording):
    return evaluate(solution.trajectory, truth_of(recording), solution.camera_p_antenna)


@pytest.fixture(scope="module")
def solution(recording):
    return vgps.smooth(vgps.open_recording(recording))


def test_every_frame_is_posed_near_the_truth(solution, recording):
    evaluation = errors(solution, recording)
    assert evaluation.every_frame_posed
    assert evaluation.camera_position_m.mean < 0.10
    assert evaluation.rotation_deg.mean < 1.5
    assert set(solution.state) == {FrameState.TRACKED}
    assert np.isfinite(solution.sigma_position_m).all() and np.isfinite(solution.sigma_rotation_rad).all()


def test_stage_d_lowers_the_cost_and_every_fix_has_a_reason(solution):
    assert sum(solution.report.cost_after.values()) <= sum(solution.report.cost_before.values())
    assert solution.fixes is not None and solution.fixes.used.all()
    assert all(reason.startswith("used") for reason in solution.fixes.reason)


def test_without_gps_the_result_says_that_it_floats(recording):
    opened = replace(vgps.open_recording(recording), gps=None)
    solution = vgps.smooth(opened)
    assert not solution.georeferenced and np.isfinite(solution.world_T_camera).all()
    assert any("no fix ties" in warning for warning in solution.warnings)


@pytest.mark.slow
def test_control_points_replace_gps(solution, recording, tmp_path):
    sightings = solution.observations
    early = sightings.frame < 25
    points = solution.landmarks.world_p_landmark[sightings.landmark[early]]
    rows = np.column_stack([sightings.frame[early], sightings.uv_px[early], points])
    file = tmp_path / "control_points.csv"
    np.savetxt(file, rows, delimiter=",", header="frame,u_px,v_px,east_m,north_m,up_m", comments="")
    opened = replace(vgps.open_recording(recording, control_points=file), gps=None)
    again = vgps.smooth(opened)
    assert again.georeferenced
    assert errors(again, recording).camera_position_m.mean < 0.3


@pytest.mark.slow
def test_black_frames_are_bridged(recording, tmp_path):
    folder = tmp_path / "dark"
    (folder / "images").mkdir(parents=True)
    times = ["file,t_s"]
    with av.open(str(recording / "video.mp4")) as container:
        for i, frame in enumerate(container.decode(video=0)):
            gray = frame.to_ndarray(format="gray")
            name = f"{i:04d}.png"
            cv2.imwrite(str(folder / "images" / name), np.zeros_like(gray) if 40 <= i < 45 else gray)
            times.append(f"{name},{i / 15:.6f}")
    (folder / "images" / "frame_times.csv").write_text("\n".join(times) + "\n")
    for name in ("camera.yaml", "rig.yaml", "gps.nmea"):
        (folder / name).write_bytes((recording / name).read_bytes())
    solution = vgps.smooth(vgps.open_recording(folder))
    assert set(np.flatnonzero([state == FrameState.BRIDGED for state in solution.state])) <= set(
        range(39, 48)
    )
    assert solution.state[42] == FrameState.BRIDGED
    assert errors(solution, recording).camera_position_m.max < 0.5


@pytest.mark.slow
def test_same_input_same_bytes(recording, tmp_path):
    for name in ("a", "b"):
        write_run(vgps.smooth(vgps.open_recording(recording)), tmp_path / name)
    for file in sorted((tmp_path / "a").iterdir()):
        if file.name != "solution.json":  # holds the seconds
            assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes(), file.name


@pytest.mark.slow
def test_kitti03_with_rtk_fixes(data_dir):
    folder = data_dir / "kitti03"
    solution = vgps.smooth(vgps.open_recording(folder, gps="gps_fix.nmea"))
    evaluation = errors(solution, folder)
    assert evaluation.every_frame_posed and len(solution.t_s) == 801
    assert evaluation.camera_position_m.mean < 0.12


@pytest.mark.slow
def test_gopro_walk_holds_one_map(data_dir):
    solution = vgps.smooth(vgps.open_recording(data_dir / "gopro_walk"))
    assert len(solution.t_s) == 315 and np.isfinite(solution.world_T_camera).all()
    assert solution.state.count(FrameState.TRACKED) == 315
    assert not solution.georeferenced
