"""A rig of two cameras from end to end, as a user has it: one path, whatever one of them sees."""

from dataclasses import replace
from pathlib import Path

import gtsam
import numpy as np
import pytest
from fewer_features import fewer_features

import vgps
from scripts.benchmarks.rigs import Darkened
from vgps.evaluation import evaluate
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, simulate
from vgps.solution import FrameState

pytestmark = pytest.mark.slow
SCENE = replace(
    SCENES["demo"],
    speed=((0.0, 1.2), (5.0, 1.2)),
    fps=7,
    width=360,
    height=240,
    focal_px=300.0,
    texture_scale=0.5,
    cameras=2,
)
FEWER_FEATURES = fewer_features(200)
NO_GPS = fewer_features(200, gps={"model": "none"})


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rig") / "walk"
    simulate(out, SCENE)
    return out


@pytest.fixture(scope="module")
def run(rig: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rig") / "run"
    vgps.write_run(vgps.smooth(vgps.open_recording(rig), FEWER_FEATURES), out)
    return out


def test_a_dark_while_of_one_camera_is_bridged_by_the_other(rig: Path) -> None:
    recording = vgps.open_recording(rig, with_gps=False)
    recording = replace(recording, video=Darkened(recording.video, 1.8, 3.5))
    solution = vgps.smooth(recording, NO_GPS)
    assert set(solution.state) == {FrameState.TRACKED}
    truth = read_trajectory(rig / "truth.tum")
    alone = vgps.smooth(replace(recording, cameras=()), NO_GPS)
    assert alone.state.count(FrameState.BRIDGED) >= 9
    errors = [evaluate(one, truth).camera_position_after_sim3_m for one in (solution, alone)]
    assert errors[0] is not None and errors[1] is not None
    assert errors[0].max < 0.05
    assert errors[0].mean < 0.5 * errors[1].mean


def test_the_run_has_one_path_in_the_world_and_every_cameras_poses(rig: Path, run: Path) -> None:
    solution, truth = read_run(run), read_trajectory(rig / "truth.tum")
    assert evaluate(solution, truth).camera_position_m.mean < 0.05
    (other,) = solution.cameras
    np.testing.assert_allclose(other.reference_T_camera[:3, :3], np.diag([-1.0, 1.0, -1.0]), atol=3e-3)
    np.testing.assert_allclose(other.reference_T_camera[:3, 3], [0.0, 0.0, -0.2], atol=0.02)
    assert (other.sigma > 0.0).all() and len(other.landmarks.sigma_px) > 100
    poses = read_trajectory(run / "cameras" / "camera_2" / "poses.tum").world_T_camera
    np.testing.assert_allclose(poses, solution.world_T_camera @ other.reference_T_camera, atol=1e-5)


def test_the_factor_graph_of_the_run_is_rebuilt(run: Path) -> None:
    solution = read_run(run)
    graph, values = vgps.factor_graph(run)
    assert graph.error(values) == pytest.approx(sum(solution.report.cost_after.values()), rel=1e-6)
    landmarks, observations = solution.all_landmarks
    assert values.exists(gtsam.symbol("l", len(landmarks.sigma_px) - 1))
    assert len(landmarks.sigma_px) == len(np.unique(observations.landmark))


def test_a_camera_measured_a_degree_off_is_put_right(rig: Path) -> None:
    recording = vgps.open_recording(rig)
    tilted = recording.cameras[0].reference_T_camera.copy()
    c, s = np.cos(np.radians(1.0)), np.sin(np.radians(1.0))
    tilted[:3, :3] = tilted[:3, :3] @ [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    sigma = np.repeat([np.radians(1.0), 0.01], 3)
    off = replace(recording.cameras[0], reference_T_camera=tilted, sigma=sigma)
    solution = vgps.smooth(replace(recording, cameras=(off,)), FEWER_FEATURES)
    found = solution.cameras[0].reference_T_camera[:3, :3]
    true = recording.cameras[0].reference_T_camera[:3, :3]
    assert np.degrees(np.arccos((np.trace(found.T @ true) - 1.0) / 2.0)) < 0.2
    assert any("the pose of camera camera_2 on the rig was refined" in note for note in solution.warnings)
