"""The factor graph of stage D, rebuilt from a run: :func:`vgps.factor_graph`."""

from pathlib import Path

import gtsam

from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run
from vgps.smoothing.stage_d.graph_arrays import last_problem
from vgps.solution import Solution
from vgps.solver.gtsam_graphs.gtsam_export import to_graph

_TOLERANCE = 1e-6  # relative, between the graph's error and the cost that the run reports
_REMEDY = "run vgps smooth again"


def factor_graph(run: Path | str | Solution) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Return the whole graph that stage D minimised last, and the values at which it ended.

    The graph's error at these values is the cost that the run reports, and ``batch: {solver: gtsam}`` lets
    GTSAM optimise just this graph. Its variables are

    - ``x<frame>``: poses world_T_camera (Pose3);
    - ``l<row>``: landmarks, rows of ``Solution.all_landmarks`` (Point3), metres;
    - ``o<number>``: offsets of the receiver in order of time, east, north, up, metres (vectors of 3), if its
      error model has memory: a fix is antenna + offset + noise;
    - ``v<knot>``: velocities world_v_camera, m/s (vectors of 3), and ``b<knot>``: biases of accelerometer
      [m/s^2] and gyro [rad/s] in the camera's axes (``imuBias.ConstantBias``), at knots of the IMU if there
      is one;
    - ``c0``: change of the time offset since the fixes were placed between frames, seconds (vector of 1), and
      ``d0``: lever arm ``camera_p_antenna``, metres (vector of 3), both if one of them is estimated;
    - ``h0``: height of the camera above the ground, metres (vector of 1), where it is known.

    Its factors are, in this order, those of the fixes (for a model with memory bounds, noise and walk of the
    offsets), priors of ``c0`` and ``d0``, zero motion and constant velocity of frames without observations,
    priors of a level camera and of one that is level with the ground, lengths of stretches by ``h0`` and its
    prior, control points, those of the IMU (which take the place of a level camera), projections, and priors
    that hold frames where nothing else ties the run to the world.

    Args:
        run: Run folder of ``vgps smooth``, or a Solution.

    Raises:
        RunFolderError: The run holds no graph of stage D, or it is damaged or of another version.
    """
    solution = run if isinstance(run, Solution) else read_run(Path(run))
    file = None if isinstance(run, Solution) else Path(run) / "measurements.npz"
    if solution.graph is None:
        raise RunFolderError(
            "no arrays graph.*, the input of stage D",
            file=file,
            expected="a result of stage D of this version",
            remedy=_REMEDY,
        )
    try:
        graph, values = to_graph(last_problem(solution, solution.graph))
        error = graph.error(values)
    except (KeyError, TypeError, ValueError, IndexError, RuntimeError) as problem:
        raise RunFolderError(
            f"the graph of stage D is damaged ({problem})", file=file, remedy=_REMEDY
        ) from problem
    reported = sum(solution.report.cost_after.values())
    if not abs(error - reported) <= _TOLERANCE * reported:
        raise RunFolderError(
            f"the graph of stage D has the cost {error:.9g}",
            file=file,
            expected=f"{reported:.9g}, as the run reports",
            remedy=f"{_REMEDY}: another version, or other settings, gave this result",
        )
    return graph, values
