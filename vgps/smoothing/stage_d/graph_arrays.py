"""The input of stage D's last problem, as arrays of a run, and back.

GTSAM cannot serialise factors written in Python, so a run keeps what its graph is made from.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.config import Config, GpsConfig
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.learned_errors import LearnedErrors
from vgps.gps.offsets import offset_key
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors, TimeOffset
from vgps.imu.camera_imu import CameraImu
from vgps.imu.states import ImuStates, bias_key, velocity_key
from vgps.mapping.control_observations import ControlObservations
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FixClass
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.ground import Ground
from vgps.smoothing.scene.height_ties import CAMERA_HEIGHT, HeightTies
from vgps.smoothing.scene.rig_views import rig_of
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch_problem import BatchInput, batch_problem
from vgps.solution import Solution
from vgps.solver.problem import BundleProblem

Arrays = Mapping[str, npt.NDArray[Any]]

_LEARNED = [column.name for column in fields(LearnedErrors)]
_SHARED = {"c0": TIME_OFFSET, "d0": ANTENNA, "h0": CAMERA_HEIGHT}


def graph_arrays(given: BatchInput, end: BundleProblem) -> dict[str, npt.NDArray[Any]]:
    """Return what :func:`vgps.factor_graph` needs beside the other fields of a Solution.

    Args:
        given: Input of the last problem of stage D.
        end: That problem at its minimum.
    """
    sensors, prior, ground = given.sensors, given.sensors.prior_time_offset, given.scene.ground
    imu_states = 0 if given.imu is None else 2 * len(given.imu)
    offsets = [end.states[offset_key(k)].vector for k in range(len(end.states) - imu_states)]
    return {
        "offsets": np.array(offsets).reshape(-1, 3),
        **{name: end.shared[key] for name, key in _SHARED.items() if key in end.shared},
        "held": end.fixed_frames,
        "video_sigma_scale": np.array(given.context.config.batch.video_sigma_scale),
        "time_offset_s": np.array(sensors.time_offset_s),
        "prior_time_offset_s": np.array([prior.time_offset_s, prior.sigma_s]),
        "prior_antenna": np.array(sensors.prior_antenna),
        "prior_antenna_sigma_m": np.array(sensors.antenna_sigma_m),
        **_fix_arrays(given.fixes),
        **({"antenna_velocity": np.asarray(given.antenna_velocity)} if sensors.is_estimated else {}),
        **_error_arrays(given.errors),
        **_zero_motion_arrays(given.scene.zero_motions),
        **{f"controls.{key}": array for key, array in vars(given.scene.controls).items()},
        "controls.sigma_px": given.control_sigma_px,
        **({} if given.scene.rates is None else {"frame_rates": given.scene.rates}),
        **({} if ground is None else {f"ground.{name}": rows for name, rows in vars(ground).items()}),
        **_imu_arrays(given, end),
        **({} if given.scene.heights is None else given.scene.heights.arrays()),
    }


def last_problem(solution: Solution, graph: Arrays) -> BundleProblem:
    """Return the last problem of stage D at its minimum.

    Args:
        solution: Result of a run.
        graph: Its arrays of :func:`graph_arrays`.
    """
    problem = batch_problem(batch_input(solution, graph)).problem
    shared = {key: graph[name] for name, key in _SHARED.items() if key in problem.shared}
    vectors = _vectors(graph)
    if vectors.keys() != problem.states.keys():
        raise ValueError(f"{len(vectors)} offsets, velocities and biases, expected {len(problem.states)}")
    states = {key: state.moved(vectors[key]) for key, state in problem.states.items()}
    return problem.moved(problem.world_T_camera, problem.world_p_landmark, shared, states)


def batch_input(solution: Solution, graph: Arrays) -> BatchInput:
    """Return the input of the last problem of stage D.

    Args:
        solution: Result of a run.
        graph: Its arrays of :func:`graph_arrays`.
    """
    config = Config.model_validate(solution.config)
    scale = float(graph["video_sigma_scale"])
    config = config.model_copy(update={"batch": config.batch.model_copy(update={"video_sigma_scale": scale})})
    controls = {key: graph[f"controls.{key}"] for key in ControlObservations.__dataclass_fields__}
    landmarks, observations = solution.all_landmarks
    return BatchInput(
        scene=Scene(
            solution.t_s,
            solution.world_T_camera,
            landmarks.world_p_landmark,
            observations,
            _zero_motions(graph),
            ControlObservations(**controls),
            rates=graph.get("frame_rates"),
            ground=Ground(**_of(graph, "ground", Ground)) if "ground.frame" in graph else None,
            heights=HeightTies.from_arrays(graph),
            rig=rig_of(solution),
        ),
        sigma_px=landmarks.sigma_px,
        control_sigma_px=graph["controls.sigma_px"],
        fixes=_fixes(graph),
        sensors=_sensors(solution, graph),
        fixed=graph["held"],
        context=SmoothingContext(solution.camera, config, imu=_imu(graph), cameras=solution.cameras),
        errors=_errors(graph, config.gps),
        imu=ImuStates(**_of(graph, "knots", ImuStates)) if "knots.frame" in graph else None,
        antenna_velocity=graph["antenna_velocity"] if "c0" in graph else None,
    )


def _imu_arrays(given: BatchInput, end: BundleProblem) -> dict[str, npt.NDArray[Any]]:
    """Return samples, knots with the biases of the preintegration, and velocities and biases at the end."""
    imu, knots = given.context.imu, given.imu
    if imu is None or knots is None:
        return {}
    at_end = knots.moved({key: state.vector for key, state in end.states.items()})
    return {
        **{f"imu.{name}": np.asarray(value) for name, value in vars(imu).items() if name != "source"},
        **{f"knots.{name}": value for name, value in vars(knots).items()},
        "velocities": at_end.velocity,
        "biases": at_end.bias,
    }


def _imu(graph: Arrays) -> CameraImu | None:
    if "imu.t_s" not in graph:
        return None
    columns = _of(graph, "imu", CameraImu)
    numbers: dict[str, Any] = {name: float(value) for name, value in columns.items() if not value.ndim}
    return CameraImu(**{**columns, **numbers})


def _of(graph: Arrays, part: str, kind: type[Any]) -> dict[str, npt.NDArray[Any]]:
    """Return the fields of a dataclass; where data came from is not kept."""
    names = [column.name for column in fields(kind) if column.name != "source"]
    return {name: graph[f"{part}.{name}"] for name in names}


def _vectors(graph: Arrays) -> dict[int, npt.NDArray[Any]]:
    """Return the values of offsets, velocities and biases by their keys."""
    keys = {"offsets": offset_key, "velocities": velocity_key, "biases": bias_key}
    return {
        key(k): vector for name, key in keys.items() for k, vector in enumerate(graph.get(name, np.zeros(0)))
    }


def _sensors(solution: Solution, graph: Arrays) -> Sensors:
    return Sensors(
        time_offset_s=float(graph["time_offset_s"]),
        camera_p_antenna=solution.camera_p_antenna,
        prior_time_offset=TimeOffset(*graph["prior_time_offset_s"].tolist()),
        prior_antenna=graph["prior_antenna"],
        antenna_sigma_m=float(graph["prior_antenna_sigma_m"]),
    )


def _fix_columns() -> list[str]:
    """Return the columns that the factors depend on: the class below counts only where it was chosen."""
    return [column.name for column in fields(Fixes) if not column.name.startswith("lower_")]


def _fix_arrays(fixes: Fixes) -> dict[str, npt.NDArray[Any]]:
    arrays = {f"fixes.{name}": getattr(fixes, name) for name in _fix_columns()}
    words = [str(CLASSES[k]) for k in fixes.fix_class.tolist()]
    return {**arrays, "fixes.fix_class": np.array(words, dtype=np.str_)}


def _fixes(graph: Arrays) -> Fixes:
    zero = np.zeros((len(graph["fixes.t_s"]), 3))  # absent in older runs
    plain = {"fixes.correlation": zero, "fixes.logging_sigma_m": zero}
    columns = {name: {**plain, **graph}[f"fixes.{name}"] for name in _fix_columns()}
    unknown = np.full((len(columns["t_s"]), 2), np.nan)
    words = [str(name) for name in CLASSES]
    numbers = [words.index(word) for word in columns["fix_class"].tolist()]
    columns["fix_class"] = np.array(numbers, dtype=np.int64)
    return Fixes(**columns, lower_r_m=unknown[:, 0], lower_h_m=unknown[:, 1], lower_shape=unknown)


def _error_arrays(errors: Mapping[FixClass, LearnedErrors]) -> dict[str, npt.NDArray[Any]]:
    columns = {
        f"errors.{name}": np.array([getattr(one, name) for one in errors.values()]) for name in _LEARNED
    }
    return {"errors.fix_class": np.array([str(name) for name in errors], dtype=np.str_), **columns}


def _errors(graph: Arrays, config: GpsConfig) -> dict[FixClass, LearnedErrors]:
    """Return the errors of the classes that were learned.

    Runs before had none, or the rates of the classes.
    """
    names = [FixClass(name) for name in graph.get("errors.fix_class", np.zeros(0, dtype=np.str_)).tolist()]
    of_class = {"errors.rate_lasts_s": np.array([config.offset_errors(name).rate_lasts_s for name in names])}
    columns = [{**of_class, **graph}[f"errors.{column}"].tolist() for column in _LEARNED if names]
    return {name: LearnedErrors(*row) for name, *row in zip(names, *columns, strict=True)}


def _zero_motion_arrays(zero_motions: tuple[ZeroMotion, ...]) -> dict[str, npt.NDArray[Any]]:
    return {
        "zero_motions.frame": np.array([one.frame for one in zero_motions], dtype=np.int64),
        "zero_motions.reference": np.array([one.reference for one in zero_motions], dtype=np.int64),
        "zero_motions.pose": np.array([one.reference_T_frame for one in zero_motions]).reshape(-1, 4, 4),
        "zero_motions.sigma": np.array([one.sigma for one in zero_motions]).reshape(-1, 6),
    }


def _zero_motions(graph: Arrays) -> tuple[ZeroMotion, ...]:
    columns = [graph[f"zero_motions.{key}"] for key in ("frame", "reference", "pose", "sigma")]
    return tuple(ZeroMotion(int(f), int(r), T, sigma) for f, r, T, sigma in zip(*columns, strict=True))
