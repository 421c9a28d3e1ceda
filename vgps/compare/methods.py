"""Comparison of the GPS models: one front end run, stage D once per model."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import Config, ErrorModel, GpsModel
from vgps.errors import TrajectoryError
from vgps.evaluation import Evaluation, evaluate, match_times
from vgps.model import FloatArray, GeodeticPoint, Recording
from vgps.pipeline.airborne import with_airborne
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.gps_clock import with_right_clock
from vgps.pipeline.offline import optimise_all
from vgps.pipeline.turned_camera import with_right_roll
from vgps.pipeline.video_speed import with_right_speed, with_video_speed
from vgps.readers.calibration.rig_file import rig_beside
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import Progress
from vgps.solution import Solution, Trajectory


class Method(NamedTuple):
    """A GPS model under the name that Kume 2010 gives it, and its error model."""

    name: str
    model: GpsModel
    error_model: ErrorModel = "memory"

    @property
    def key(self) -> str:
        """The model, with its error model if that is not the default."""
        return self.model if self.error_model == "memory" else f"{self.model}-{self.error_model}"

    def configured(self, config: Config) -> Config:
        """Return the configuration with this method's models."""
        gps = config.with_gps(self.model).gps.model_copy(update={"error_model": self.error_model})
        return config.model_copy(update={"gps": gps})


METHODS = (
    Method("A video only", "none"),
    Method("B Gaussian, accuracy ignored (14)", "gaussian"),
    Method("C Gaussian, receiver's sigma (15)", "gaussian-receiver"),
    Method("D ellipsoid (22)", "ellipsoid"),
    Method("cylinder (16)", "cylinder"),
    Method("Cauchy on (15)", "cauchy"),
)
ALL_METHODS = (*METHODS, Method("cylinder (16), independent errors", "cylinder", "independent"))
"""Those of the thesis, a robust one, and the thesis' error model."""
_FIRST_FRAMES = 30  # their true poses place the run without GPS, as control points do in Kume 2010


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Results of several methods on one recording.

    Attributes:
        recording: The recording's folder.
        truth: The true path in the world of the runs.
        evaluations: Errors by name of the method, in the order of the methods.
        paths: (F, 3) camera centres by name of the method.
        world_p_fix: (M, 3) the fixes.
        seconds: Seconds of stage D by name of the method.
    """

    recording: Path
    truth: Trajectory
    evaluations: dict[str, Evaluation]
    paths: dict[str, FloatArray]
    world_p_fix: FloatArray
    seconds: dict[str, float]


def compare(
    recording: Recording,
    truth: Path,
    config: Config,
    progress: Progress,
    methods: Sequence[Method] = ALL_METHODS,
) -> Comparison:
    """Run the front end once and stage D for every method, and evaluate the results.

    The method without GPS has a front end run of its own; it is placed in the world by the true poses of its
    first frames.

    Args:
        recording: A recording with a GPS log.
        truth: TUM file in ENU; a ``rig.yaml`` beside it may give its origin and clock.
        config: All settings but the GPS model.
        progress: Reports the progress.
        methods: The methods.

    Raises:
        VgpsError: The recording does not determine the answer, or the truth belongs to another one.
    """
    rig = rig_beside(truth)
    true = read_trajectory(truth, video_start_s=rig.video_start_s)
    evaluations, paths, seconds = {}, {}, {}
    fixes = np.zeros((0, 3))
    for front, method, settings in front_ends(recording, config, progress, methods):
        progress.stage(f"stage D: {method.name}")
        solution = optimise_all(front, settings)
        check_origin(solution.world_origin, rig.world_origin, truth)
        if method.model == "none":
            solution = _place(solution, true)
        evaluations[method.name] = evaluate(solution, true)
        paths[method.name] = solution.world_T_camera[:, :3, 3]
        seconds[method.name] = solution.seconds["batch"]
        if solution.fixes is not None:
            fixes = solution.fixes.world_p_fix
    return Comparison(
        recording=recording.path,
        truth=true,
        evaluations=evaluations,
        paths=paths,
        world_p_fix=fixes,
        seconds=seconds,
    )


def front_ends(
    recording: Recording, config: Config, progress: Progress, methods: Sequence[Method]
) -> Iterable[tuple[FrontEnd, Method, Config]]:
    """Yield every method with its front end and its settings.

    All share one run with the model of ``config``, its GPS clock and the camera's roll, except the method
    without GPS, whose run gets no fix.

    Raises:
        VgpsError: The recording does not determine the answer.
    """
    shared: FrontEnd | None = None
    config, recording = with_airborne(recording, config), with_video_speed(recording, config)
    for method in methods:
        if method.model == "none":
            without = config.with_gps("none")
            yield run_front_end(recording, without, progress), method, method.configured(without)
            continue
        if shared is None:
            shared = run_front_end(recording, config, progress)
            shared, config = with_right_speed(shared, config, progress)
            shared, config = with_right_clock(shared, config, progress)
            shared, config = with_right_roll(shared, config, progress)
        yield shared, method, method.configured(config)


def _place(solution: Solution, true: Trajectory) -> Solution:
    """Return the solution after the similarity that brings its first frames to their true poses."""
    e, t = match_times(solution.t_s, true.t_s, float(np.median(np.diff(solution.t_s))) / 2)
    e, t = e[:_FIRST_FRAMES], t[:_FIRST_FRAMES]
    if len(e) < 2:
        raise TrajectoryError(
            f"the truth has {len(e)} of the first frames",
            expected=f"2 to {_FIRST_FRAMES} to place the video by",
        )
    estimated, wanted = solution.world_T_camera[e], true.world_T_camera[t]
    length = [np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum() for poses in (estimated, wanted)]
    R = Rotation.from_matrix(wanted[:, :3, :3] @ estimated[:, :3, :3].transpose(0, 2, 1)).mean().as_matrix()
    scale = float(length[1] / max(length[0], 1e-12))
    poses = solution.world_T_camera.copy()
    poses[:, :3, :3] = R @ poses[:, :3, :3]
    shift = wanted[:, :3, 3].mean(axis=0) - scale * R @ estimated[:, :3, 3].mean(axis=0)
    poses[:, :3, 3] = scale * poses[:, :3, 3] @ R.T + shift
    sigma = scale * solution.sigma_position_m
    return replace(solution, georeferenced=True, world_T_camera=poses, sigma_position_m=sigma, graph=None)


def check_origin(origin: GeodeticPoint | None, true: GeodeticPoint | None, truth: Path) -> None:
    """Raise TrajectoryError if a run and its truth have different world origins."""
    if origin is not None and true is not None and not np.allclose(origin, true, rtol=0, atol=1e-9):
        raise TrajectoryError(
            "the truth's world_origin is not the recording's",
            file=truth,
            remedy="give the same world_origin in both rig.yaml",
        )
