"""How do time and memory of stage D grow with the length of the recording?

The tracks and fixes of a run are repeated along its path, forwards, backwards, forwards ...; a short track
that reaches a turn goes on behind it. Poses and landmarks start off by 5 cm. Every length runs in a process
of its own, whose peak memory is noted before stage D and at its end. What is linear grows by the factors of
the first row.
"""

import argparse
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from scripts.common.command import ScriptParser
from scripts.common.lengths import Figures, measure_lengths
from scripts.common.stopwatch import stopwatch
from vgps.errors import RunFolderError
from vgps.gps.antenna_path import antenna_velocities
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import detect_outliers
from vgps.gps.sensors import Sensors
from vgps.gps.time_offset import update_time_offset
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.readers.run_folder import read_run
from vgps.runtime.memory import peak_memory_mb
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.smoothing.stage_d.graph_arrays import batch_input
from vgps.solution import Observations

_START_M = 0.05  # standard deviation of the start of poses and landmarks about the run's


def repeated(given: BatchInput, times: int) -> BatchInput:
    """Return the input of stage D for a recording that goes to and fro so many times."""
    scene, rng = given.scene, np.random.default_rng(0)
    last, interval_s = len(scene.t_s) - 1, float(np.median(np.diff(scene.t_s)))
    t_s = interval_s * np.arange(last * times + 1, dtype=np.float64)
    passes = [scene.poses[-2::-1] if number % 2 else scene.poses[1:] for number in range(times)]
    poses: FloatArray = np.concatenate([scene.poses[:1], *passes])
    poses[:, :3, 3] += rng.normal(0.0, _START_M, (len(poses), 3))
    observations, points = _observations(scene, times)
    points += rng.normal(0.0, _START_M, points.shape)
    fixes = _fixes(given.fixes, scene.t_s[0], last * interval_s, times)
    scene = Scene(t_s, poses, points, observations)
    velocity = antenna_velocities(scene.trajectory, fixes.t_s, given.sensors.camera_p_antenna)
    return replace(given, scene=scene, fixes=fixes, fixed=None, antenna_velocity=velocity)


def _observations(scene: Scene, times: int) -> tuple[Observations, FloatArray]:
    """Return the observations of all passes, without the frames at turns twice, and their landmarks."""
    seen = scene.observations
    frame, landmark, uv_px = seen.frame, seen.landmark, seen.uv_px
    last, count = len(scene.t_s) - 1, len(scene.points)
    views = np.bincount(landmark, minlength=count)
    at_turn = [_seen_in(scene, edge) & (views <= np.median(views)) for edge in (0, last)]
    ids, rows, size = np.arange(count), [], count
    points = [scene.points]
    for number in range(times):
        if number:
            kept = at_turn[number % 2]
            points.append(scene.points[~kept])
            ids = np.where(kept, ids, size + np.cumsum(~kept) - 1)
            size += int((~kept).sum())
        inner = frame != (last if number % 2 else 0) if number else np.ones(len(frame), dtype=bool)
        at = last * number + (last - frame if number % 2 else frame)
        rows.append(Observations(at[inner], ids[landmark[inner]], uv_px[inner]))
    return Observations.stacked(rows), np.concatenate(points)


def _seen_in(scene: Scene, frame: int) -> BoolArray:
    seen = np.zeros(len(scene.points), dtype=bool)
    seen[scene.observations.landmark[scene.observations.frame == frame]] = True
    return seen


def _fixes(fixes: Fixes, start_s: float, pass_s: float, times: int) -> Fixes:
    t_s = fixes.t_s - start_s
    fixes = fixes.where((t_s > 0.0) & (t_s < pass_s) & fixes.used)
    t_s = fixes.t_s - start_s
    rows: IntArray = np.arange(len(t_s))
    order = [rows[::-1] if number % 2 else rows for number in range(times)]
    at_s = [pass_s * k + (pass_s - t_s[one] if k % 2 else t_s[one]) for k, one in enumerate(order)]
    columns = {column.name: getattr(fixes, column.name)[np.concatenate(order)] for column in fields(fixes)}
    return Fixes(**{**columns, "t_s": np.concatenate(at_s)})


def one_length(given: argparse.Namespace, times: int) -> Figures:
    """Run stage D on so many passes in this process; return seconds, memory and counts."""
    run = read_run(given.run)
    if run.graph is None:
        raise RunFolderError("no arrays graph.*", file=given.run, remedy="run vgps smooth again")
    long = repeated(batch_input(run, run.graph), times)
    scene, fixes, antenna = long.scene, long.fixes, long.sensors.camera_p_antenna
    config = long.context.config
    batch = config.batch.model_copy(update={"iterations": given.iterations})
    context = replace(long.context, config=config.model_copy(update={"batch": batch}))
    prior = Sensors.from_config(antenna, config.sensors)
    before_mb = peak_memory_mb()
    with stopwatch() as outliers:
        detect_outliers(scene.trajectory, fixes, antenna, config)
    with stopwatch() as time_offset:
        update_time_offset(prior, scene.trajectory, fixes, config.sensors)
    with stopwatch() as whole:
        result = optimise_batch(scene, fixes, prior, context)
    return {
        "frames": len(scene.t_s),
        "observations": len(scene.observations.frame),
        "fixes": len(fixes),
        "outlier detection, CPU [s]": outliers.cpu_s,
        "time offset, CPU [s]": time_offset.cpu_s,
        "stage D, CPU [s]": whole.cpu_s,
        "stage D, wall [s]": whole.wall_s,
        "iterations of D": result.report.iterations,
        "memory before [MB]": before_mb,
        "memory, peak [MB]": peak_memory_mb(),
        "cost after": sum(result.report.cost_after.values()),
    }


def main() -> None:
    """Measure every length."""
    parser = ScriptParser("benchmarks.long", __doc__)
    parser.add_argument("run", type=Path, help="run folder")
    parser.add_argument("--times", type=int, nargs="+", default=[5, 20, 80], help="passes")
    parser.add_argument("--iterations", type=int, default=4, help="of a round of stage D at most")
    measure_lengths(parser, "times", one_length)


if __name__ == "__main__":
    main()
