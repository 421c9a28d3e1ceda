"""Several runs of one area in one adjustment, tied by the places that they share."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vgps.config import Config
from vgps.errors import RunFolderError
from vgps.geodesy import enu_T_enu
from vgps.gps.sensors import Sensors
from vgps.model import Frame, IntArray, Recording
from vgps.pipeline.join_checkpoint import JoinCheckpoint
from vgps.pipeline.loop_closure import kept_loops, with_loops
from vgps.pipeline.run_parts import all_landmarks, part_of_run
from vgps.pipeline.shown_frames import shown_frames
from vgps.places.common_camera import seen_by
from vgps.places.loops import find_loops
from vgps.places.revisits import PosedVideo
from vgps.runtime.progress import NoProgress, Progress
from vgps.runtime.threads import one_blas_thread
from vgps.runtime.timing import StageTimer
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.smoothing.stage_d.graph_arrays import batch_input
from vgps.smoothing.stage_d.joint_scene import JointScene, joint_scene
from vgps.solution import JoinedRuns, Solution


@dataclass(frozen=True, kw_only=True)
class Run:
    """A run that is to be joined with others: its name, its solution, and its recording for the pictures."""

    name: str
    solution: Solution
    recording: Recording


def join_runs(
    runs: Sequence[Run],
    config: Config | None = None,
    progress: Progress | None = None,
    checkpoint: JoinCheckpoint | None = None,
) -> JoinedRuns:
    """Return runs of one area as one adjustment gives them: fixes of all, and places seen by several.

    Verdicts on fixes, time offsets, lever arms and calibrations are those of each run.

    Args:
        runs: At least two, each georeferenced.
        config: Settings; by default those of the first run.
        progress: Progress display.
        checkpoint: Where an interrupted adjustment goes on.

    Raises:
        RunFolderError: A run is not georeferenced, holds no graph of stage D or has several cameras, or
            shutters roll that cannot be joined.
        GeometryError: No step lowers the cost.
    """
    progress, timer = progress or NoProgress(), StageTimer()
    inputs = [_input(run) for run in runs]
    _check_shutters(runs)
    config = _joint_config(config or inputs[0].context.config)
    origins = [run.solution.world_origin for run in runs if run.solution.world_origin is not None]
    joint = joint_scene(inputs, np.stack([enu_T_enu(origins[0], one) for one in origins]))
    with one_blas_thread():
        with timer.measure("places"):
            frames = progress.track(_frames(runs, joint), len(joint.scene.t_s))
            find = partial(find_loops, _posed_video(runs, joint), frames, config.loops)
            loops = find() if checkpoint is None else checkpoint.loops(find)
        scene = with_loops(joint.scene, loops, joint.camera) if loops else joint.scene
        progress.stage("optimising all runs (D)")
        with timer.measure("batch"):
            journal = None if checkpoint is None else checkpoint.journal
            context = SmoothingContext(joint.camera, config, scene.controls, journal=journal)
            batch = optimise_batch(scene, joint.fixes, Sensors.fixed(joint.camera_p_antenna), context)
    ties = np.zeros((len(runs), len(runs)), np.int64)
    np.add.at(ties, tuple(joint.run[kept_loops(loops, batch)].T), 1)
    warnings = _warnings(runs, ties)
    before = [run.solution for run in runs]
    landmarks, observations = all_landmarks(before, batch)
    return JoinedRuns(
        names=tuple(run.name for run in runs),
        solutions=tuple(part_of_run(before, k, joint, batch, warnings) for k in range(len(runs))),
        landmarks=landmarks,
        observations=observations,
        ties=ties,
        warnings=(*warnings, *batch.warnings),
        seconds=dict(timer.by_stage),
    )


def _input(run: Run) -> BatchInput:
    """Return what stage D minimised last for a run."""
    solution = run.solution
    if not solution.georeferenced or solution.world_origin is None:
        raise RunFolderError(
            "is not georeferenced, so that nothing says where it lies",
            file=run.name,
            remedy="smooth the recording with GPS or control points",
        )
    if solution.graph is None:
        raise RunFolderError(
            "holds no arrays graph.*, the input of stage D", file=run.name, remedy="run vgps smooth again"
        )
    if solution.cameras:
        raise RunFolderError(
            f"a run of {1 + len(solution.cameras)} cameras",
            file=run.name,
            expected="runs of one camera each",
            remedy="smooth this recording with a rig.yaml without the key cameras: --rig FILE; a picture of "
            "more than 180 degrees cannot be joined",
        )
    return replace(batch_input(solution, solution.graph), imu=None)


def _check_shutters(runs: Sequence[Run]) -> None:
    """Refuse rolling shutters of different cameras: one camera stands for all."""
    cameras = [run.solution.camera for run in runs]
    kinds = {(one.width, one.height, one.readout_axis, round(one.readout_s or 0.0, 4)) for one in cameras}
    if len(kinds) > 1 and any(one.readout_s for one in cameras):
        readouts = ", ".join(
            f"{run.name}: {one.width} x {one.height}, {one.readout_axis}, {one.readout_s or 0.0:g} s"
            for run, one in zip(runs, cameras, strict=True)
        )
        raise RunFolderError(
            f"rolling shutters that differ ({readouts})",
            expected="runs of one camera, or global shutters",
            remedy="join runs of one camera only",
        )


def _joint_config(config: Config) -> Config:
    """Return settings under which the verdicts of the runs stay, and their sensors are held.

    Two rounds at least, since the first takes all places for true.
    """
    outliers = config.outliers.model_copy(update={"enabled": False})
    batch = config.batch.model_copy(update={"rounds": max(config.batch.rounds, 2)})
    sensors = config.sensors.model_copy(update={"estimate_time_offset": "no", "estimate_antenna": False})
    return config.model_copy(update={"outliers": outliers, "sensors": sensors, "batch": batch})


def _posed_video(runs: Sequence[Run], joint: JointScene) -> PosedVideo:
    sigma_m = np.concatenate([run.solution.sigma_position_m.max(axis=1) for run in runs])
    scene = joint.scene
    return PosedVideo(
        poses=scene.poses,
        sigma_m=sigma_m,
        points=scene.points,
        observations=scene.observations,
        camera=joint.camera,
        run=joint.run,
    )


def _frames(runs: Sequence[Run], joint: JointScene) -> Iterator[Frame]:
    """Yield the frames of all runs as the first run's camera shows them."""
    for run, first in zip(runs, joint.frames[:-1].tolist(), strict=True):
        frames = shown_frames(run.recording, run.solution.left_out)
        yield from seen_by(joint.camera, run.solution.camera, frames, first)


def _warnings(runs: Sequence[Run], ties: IntArray) -> tuple[str, ...]:
    """Return what the user should know: runs that share no place with others, IMUs that no longer count."""
    shared = ties.sum(axis=0) + ties.sum(axis=1)
    apart = [run.name for run, count in zip(runs, shared.tolist(), strict=True) if count == 0]
    inertial = [run.name for run in runs if any(key.startswith("imu.") for key in run.solution.graph or {})]
    notes = []
    if apart:
        notes.append(
            f"no place seen by another run is seen by {', '.join(apart)}: only the fixes relate it to them"
        )
    if inertial:
        notes.append(f"the IMU of {', '.join(inertial)} counts in its own run, not in the joint adjustment")
    return tuple(notes)
