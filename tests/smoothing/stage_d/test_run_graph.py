"""The factor graph of a run: that of the last problem of stage D, at its minimum."""

import re
from dataclasses import replace
from pathlib import Path

import gtsam
import numpy as np
import pytest
from brief_videos import first_frames
from gtsam.symbol_shorthand import X
from inertial import MOUNT, SplineMotion, exact_log
from measurement_keys import documented
from solutions import make_landmarks, make_solution
from synthetic_bundle import ANTENNA
from synthetic_map import CAMERA, context, map_of, scene
from textured_room import CONFIG as ROOM_CONFIG
from textured_room import path, room_recording

import vgps
from vgps.config import BatchConfig, Config, GpsConfig, ImuConfig, IntrinsicsConfig, SensorsConfig
from vgps.errors import RunFolderError
from vgps.gps.sensors import ANTENNA as ANTENNA_KEY
from vgps.gps.sensors import TIME_OFFSET, Sensors, TimeOffset
from vgps.imu.camera_imu import imu_at_camera
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FixClass
from vgps.readers.run_folder import read_run
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.solution import Observations, Trajectory
from vgps.solver import gtsam_backend
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.graph_optimiser import optimise_graph
from vgps.solver.gtsam_graphs.graph_reading import read_graph
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.levenberg_marquardt import SolverSettings
from vgps.writers.run_folder import write_run

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def run(smoothed_walk, tmp_path_factory):
    folder = tmp_path_factory.mktemp("graph") / "run"
    write_run(smoothed_walk, folder)
    return folder


def kinds(values):
    return {chr(gtsam.Symbol(key).chr()) for key in list(values.keys())}


def optimised(graph, values):
    """Where GTSAM's Levenberg-Marquardt ends, landmarks eliminated first."""
    parameters, keys = gtsam.LevenbergMarquardtParams(), list(values.keys())
    ordering = gtsam.Ordering()
    for key in sorted(keys, key=lambda key: gtsam.Symbol(key).chr() != ord("l")):
        ordering.push_back(key)
    parameters.setOrdering(ordering)
    parameters.setRelativeErrorTol(1e-9)
    return gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()


def check_minimum(solution, graph, values, gain=1e-6, moves_m=1e-3):
    """The graph has the reported cost, GTSAM finds no lower one nearby, and its arrays are documented."""
    assert {f"graph.{key}" for key in solution.graph} <= documented()
    reported = sum(solution.report.cost_after.values())
    assert graph.error(values) == pytest.approx(reported, rel=1e-9)
    end = optimised(graph, values)
    assert (1.0 - gain) * reported < graph.error(end) <= graph.error(values)
    moved = [
        np.linalg.norm(end.atPose3(X(i)).translation() - pose[:3, 3])
        for i, pose in enumerate(solution.world_T_camera)
    ]
    assert max(moved) < moves_m


def test_the_graph_of_a_run_folder_is_at_its_minimum(run):
    solution = read_run(run)
    graph, values = vgps.factor_graph(run)
    assert kinds(values) == {"x", "l", "o"}
    assert values.size() == len(solution.t_s) + len(solution.landmarks.sigma_px) + len(
        solution.graph["offsets"]
    )
    np.testing.assert_array_equal(values.atVector(gtsam.symbol("o", 1)), solution.graph["offsets"][1])
    check_minimum(solution, graph, values)
    assert vgps.factor_graph(solution)[0].error(values) == graph.error(values)


def moved(values, keys):
    """Values a little off, under other keys in the same order."""
    rng, out = np.random.default_rng(1), gtsam.Values()
    for key, new in zip(sorted(values.keys()), sorted(keys), strict=True):
        if chr(gtsam.Symbol(key).chr()) == "x":
            out.insert(new, values.atPose3(key).retract(rng.normal(0.0, 1e-3, 6)))
        elif chr(gtsam.Symbol(key).chr()) == "b":
            out.insert(new, values.atConstantBias(key).retract(rng.normal(0.0, 1e-3, 6)))
        else:
            vector = values.atVector(key)
            out.insert(new, vector + rng.normal(0.0, 1e-2, len(vector)))
    return out


def check_gradient(graph, values):
    """A little off the minimum, the fast engine's gradient is GTSAM's."""
    bundle = read_graph(graph, moved(values, values.keys()))
    problem, structure = bundle.problem, analyse_sparsity(bundle.problem)
    linear = linearise(problem, all_pose_values(problem), structure)
    gradient = graph.linearize(bundle.values).gradientAtZero()

    def check(found, keys):
        expected = np.array([gradient.at(key) for key in keys]).reshape(found.shape)
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())

    check(structure.to_frames(linear.gradient), problem.keys.tolist())
    for part in linear.chunks:
        check(part.gradient.T, bundle.landmark_keys[part.chunk.landmarks].tolist())
    assert len(problem.states) > 10
    for key, place in structure.states.items():
        check(linear.gradient[6 * place : 6 * place + len(problem.states[key].vector)], [key])


def batch_run(config, with_imu=False, **scene_parts):
    """A Solution of stage D over the synthetic drive, with lever arm and time offset estimated."""
    problem, true, t_s, fixes = scene(disturbed=0.2)
    given = replace(context(config), imu=imu_of(Trajectory(t_s, true)) if with_imu else None)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    seen = made.observations
    still = seen.frame != 30  # it stands at the frame before it, and sees nothing
    others = Observations(seen.frame[still], seen.landmark[still], seen.uv_px[still])
    made = replace(made, observations=others, **scene_parts)
    wrong = ANTENNA + 0.05
    sensors = Sensors(0.0, wrong, TimeOffset(0.0, 0.1), wrong, 0.1)
    late = replace(fixes, sigma_m=np.full((len(fixes), 3), 0.02), t_s=fixes.t_s + 0.06)
    found = optimise_batch(made, late, sensors, given)
    kept = np.flatnonzero(np.isfinite(found.sigma_px))
    return make_solution(
        made.t_s,
        found.trajectory.world_T_camera,
        camera=CAMERA,
        camera_p_antenna=found.sensors.camera_p_antenna,
        landmarks=make_landmarks(found.points[kept], sigma_px=found.sigma_px[kept]),
        observations=replace(found.observations, landmark=np.searchsorted(kept, found.observations.landmark)),
        report=found.report,
        config=config.model_dump(mode="json"),
        graph=found.graph,
    )


def imu_of(path):
    """The IMU of a path, with biases."""
    log = exact_log(SplineMotion(path), duration_s=5.5, gyro_bias=0.02, accelerometer_bias=-0.1)
    return imu_at_camera(log, MOUNT, None, ImuConfig())


def controls_and_a_stop():
    """Three observed control points, inaccurately known, and a frame that stands still."""
    problem, true, _, _ = scene()
    rows = np.flatnonzero(problem.frame == 12)[:3]
    points = problem.world_p_landmark[problem.landmark[rows]]
    controls = ControlObservations(problem.frame[rows], problem.uv_px[rows], points, np.full((3, 3), 0.1))
    stop = ZeroMotion(30, 29, np.linalg.inv(true[29]) @ true[30], np.array([0.01] * 3 + [0.05] * 3))
    return {"controls": controls, "zero_motions": (stop,)}


@pytest.mark.parametrize("error_model", ["memory", "independent"])
def test_every_part_of_stage_d_survives_the_run_folder(error_model, tmp_path):
    config = Config(
        gps=GpsConfig(error_model=error_model),
        batch=BatchConfig(balance="estimated", relative_tolerance=1e-9),
        sensors=SensorsConfig(estimate_time_offset="yes"),
    )
    solution = batch_run(config, **controls_and_a_stop())
    assert solution.graph["video_sigma_scale"] != config.batch.video_sigma_scale
    if error_model == "independent":  # with memory the problem holds the time offset
        assert abs(solution.graph["c0"]) > 1e-6 and solution.graph["time_offset_s"] > 0.01
    write_run(solution, tmp_path / "run")
    graph, values = vgps.factor_graph(str(tmp_path / "run"))
    assert kinds(values) == {"x", "l", "c", "d"} | ({"o"} if error_model == "memory" else set())
    np.testing.assert_array_equal(values.atVector(ANTENNA_KEY), solution.camera_p_antenna)
    np.testing.assert_array_equal(values.atVector(TIME_OFFSET), solution.graph["c0"])
    check_minimum(solution, graph, values)


def test_velocities_and_biases_of_an_imu_are_in_the_graph(tmp_path):
    solution = batch_run(Config(batch=BatchConfig(relative_tolerance=1e-9)), with_imu=True)
    write_run(solution, tmp_path / "run")
    graph, values = vgps.factor_graph(tmp_path / "run")
    assert kinds(values) == {"x", "l", "o", "c", "d", "v", "b"}
    check_minimum(solution, graph, values)
    bias = values.atConstantBias(gtsam.symbol("b", 3))
    np.testing.assert_allclose(bias.gyroscope(), np.full(3, 0.02) @ MOUNT.imu_R_camera, atol=3e-3)
    types = [type(graph.at(k)).__name__ for k in range(graph.size())]
    knots = sum(gtsam.Symbol(key).chr() == ord("v") for key in list(values.keys()))
    assert types.count("ImuFactor") == knots - 1 >= 8


def test_gtsam_as_the_solver_optimises_exactly_this_graph(monkeypatch):
    given, to_graph = [], gtsam_backend.to_graph

    def recorded(problem):
        given.append(to_graph(problem))
        return given[-1]

    monkeypatch.setattr(gtsam_backend, "to_graph", recorded)
    config = Config(batch=BatchConfig(solver="gtsam"))
    solution = batch_run(config, with_imu=True, **controls_and_a_stop())
    graph, values = vgps.factor_graph(solution)
    last, start = given[-1]  # its landmarks have the numbers from before the selection
    assert graph.size() == last.size() and graph.error(values) <= last.error(start)
    here, there = moved(values, values.keys()), moved(values, start.keys())
    for k in range(graph.size()):
        assert type(graph.at(k)) is type(last.at(k))
        assert graph.at(k).error(here) == pytest.approx(last.at(k).error(there), rel=1e-9, abs=1e-12), k


def test_a_video_alone_keeps_its_held_frames():
    solution = vgps.smooth(room_recording(path(16)), ROOM_CONFIG)
    graph, values = vgps.factor_graph(solution)
    assert kinds(values) == {"x", "l"}
    check_minimum(solution, graph, values)
    held = X(int(np.flatnonzero(solution.graph["held"])[1]))
    end = optimised(graph, moved(values, values.keys()))
    np.testing.assert_allclose(end.atPose3(held).matrix(), values.atPose3(held).matrix(), atol=1e-12)


def test_a_refined_camera_is_that_of_the_graph(brief):
    config = Config(intrinsics=IntrinsicsConfig(refine="yes"))
    solution = vgps.smooth(vgps.open_recording(brief), config)
    assert solution.camera.fx != vgps.open_recording(brief).camera.fx
    check_minimum(solution, *vgps.factor_graph(solution))


def test_the_fast_engine_ends_at_gtsams_minimum_on_a_real_drive(data_dir):
    drive = vgps.open_recording(data_dir / "kitti07", gps="gps_ublox.nmea")
    solution = vgps.smooth(first_frames(drive, 60))
    graph, values = vgps.factor_graph(solution)
    assert "o" in kinds(values)
    check_gradient(graph, values)
    check_minimum(solution, graph, values, gain=1e-4, moves_m=0.01)


def test_gtsam_ends_at_the_fast_engines_minimum_on_a_real_drive_with_an_imu(data_dir):
    drive = vgps.open_recording(data_dir / "kitti07", gps="gps_float.nmea", rig="rig_imu.yaml")
    drive = first_frames(drive, 50)
    config = Config(
        batch=BatchConfig(solver="gtsam"),
        sensors=SensorsConfig(estimate_time_offset="no"),  # each trial of another one is a solution by GTSAM
        intrinsics=IntrinsicsConfig(refine="no"),
    )
    graph, values = vgps.factor_graph(vgps.smooth(drive, config))
    assert kinds(values) >= {"x", "l", "o", "v", "b"}
    check_gradient(graph, values)
    end = optimise_graph(graph, values, SolverSettings(relative_tolerance=1e-9))
    assert end.solver == "schur" and end.error_after > (1.0 - 1e-4) * graph.error(values)
    moved_m = [
        np.linalg.norm(end.values.atPose3(X(i)).translation() - values.atPose3(X(i)).translation())
        for i in range(len(drive.video.times_s))
    ]
    assert max(moved_m) < 0.01


def test_a_graph_from_before_correlations_has_none(run):
    solution = read_run(run)
    older = {name: array for name, array in solution.graph.items() if name != "fixes.correlation"}
    _, values = vgps.factor_graph(replace(solution, graph=older))
    assert values.size() == vgps.factor_graph(solution)[1].size()


def test_a_graph_from_before_rates_were_learned_has_those_of_the_classes(run):
    solution = read_run(run)
    name = solution.graph["fixes.fix_class"][0]
    errors = Config.model_validate(solution.config).gps.offset_errors(FixClass(str(name)))
    learned = {key: np.array([getattr(errors, key)]) for key in ("noise_m", "walk_m")}
    older = {key: array for key, array in solution.graph.items() if key != "errors.rate_lasts_s"}
    older |= {"errors.fix_class": np.array([name]), **{f"errors.{key}": one for key, one in learned.items()}}
    vgps.factor_graph(replace(solution, graph=older))  # at the cost that the run reports
    longer = {**older, "errors.rate_lasts_s": np.array([4.0 * errors.rate_lasts_s])}
    with pytest.raises(RunFolderError, match="has the cost"):
        vgps.factor_graph(replace(solution, graph=longer))


def test_an_older_run_without_the_input_of_stage_d_says_so(run, tmp_path):
    solution = replace(read_run(run), graph=None)
    write_run(solution, tmp_path / "run")
    with pytest.raises(RunFolderError, match=r"measurements\.npz: no arrays graph.*run vgps smooth again"):
        vgps.factor_graph(tmp_path / "run")
    with pytest.raises(RunFolderError, match=r"^no arrays graph"):
        vgps.factor_graph(solution)


@pytest.mark.parametrize(
    ("key", "change", "message"),
    [
        ("offsets", lambda array: array[:-1], r"damaged \(\d offsets.*, expected \d\)"),
        ("fixes.fix_class", lambda array: np.full_like(array, "bad"), "damaged .*'bad'"),
        ("held", lambda array: array[1:], "damaged .*fixed has shape"),
        ("prior_antenna", lambda _: None, "damaged .*prior_antenna"),
        ("video_sigma_scale", lambda array: 2.0 * array, r"has the cost .*; expected .*as the run reports"),
    ],
)
def test_a_graph_that_is_not_that_of_the_run_is_refused(run, key, change, message):
    solution = read_run(run)
    arrays = {**solution.graph, key: change(solution.graph[key])}
    arrays = {name: array for name, array in arrays.items() if array is not None}
    with pytest.raises(RunFolderError, match=message):
        vgps.factor_graph(replace(solution, graph=arrays))


def test_the_example_of_the_readme_runs(run, monkeypatch, capsys):
    monkeypatch.chdir(run.parent)
    text = (ROOT / "vgps/smoothing/README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)
    exec(compile(example, "README.md", "exec"), {})
    shift, offset = capsys.readouterr().out.splitlines()
    assert float(shift) > 0.0 and len(offset.strip("[]").split()) == 3
