"""One front end run, stage D once per GPS model: only the model differs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import Config, GpsModel
from vgps.errors import TrajectoryError
from vgps.evaluation import Evaluation, evaluate, match_times
from vgps.model import FloatArray, GeodeticPoint, Recording
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.offline import optimise_all
from vgps.readers.calibration import rig_beside
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import Progress
from vgps.solution import Solution, Trajectory


class Method(NamedTuple):
    """A GPS model under the name that Kume 2010 gives it."""

    name: str
    model: GpsModel


METHODS = (
    Method("A video only", "none"),
    Method("B Gaussian, accuracy ignored (14)", "gaussian"),
    Method("C Gaussian, receiver's sigma (15)", "gaussian-receiver"),
    Method("D ellipsoid (22)", "ellipsoid"),
    Method("cylinder (16)", "cylinder"),
    Method("Cauchy on (15)", "cauchy"),
)
_FIRST_FRAMES = 30  # whose true poses give a video alone its place, as control points do in Kume 2010


@dataclass(frozen=True)
class Comparison:
    """What came out.

    Attributes:
        recording: Which.
        truth: The true path, in the world of the runs.
        evaluations, paths: By method, in the order asked for; (F, 3) camera centres.
        world_p_fix: (M, 3) the fixes.
        seconds: Of stage D, by method.
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
    methods: Sequence[Method] = METHODS,
) -> Comparison:
    """Run the front end once, stage D for every method, and evaluate them all.

    The video alone has a front end of its own, which sees no fix; the poses of its first frames put it into
    the world.

    Args:
        recording: With a GPS log.
        truth: TUM file in ENU; a ``rig.yaml`` beside it names its origin and clock.
        config: Of everything but the GPS model.
        progress: Shows how far it is.
        methods: Which.

    Raises:
        VgpsError: The recording does not determine the answer, or the truth is of another one.
    """
    rig = rig_beside(truth)
    true = read_trajectory(truth, video_start_s=rig.video_start_s)
    evaluations, paths, seconds = {}, {}, {}
    fixes = np.zeros((0, 3))
    for front, method in front_ends(recording, config, progress, methods):
        progress.stage(f"stage D: {method.name}")
        solution = optimise_all(front, config.with_gps(method.model))
        check_world(solution.world_origin, rig.world_origin, truth)
        if method.model == "none":
            solution = _placed(solution, true)
        evaluations[method.name] = evaluate(solution, true)
        paths[method.name] = solution.world_T_camera[:, :3, 3]
        seconds[method.name] = solution.seconds["batch"]
        if solution.fixes is not None:
            fixes = solution.fixes.world_p_fix
    return Comparison(recording.path, true, evaluations, paths, fixes, seconds)


def front_ends(
    recording: Recording, config: Config, progress: Progress, methods: Sequence[Method]
) -> Iterable[tuple[FrontEnd, Method]]:
    """Yield every method with its front end.

    All share one run, made with the model of ``config``, but for the video alone, whose front end sees no
    fix.

    Raises:
        VgpsError: The recording does not determine the answer.
    """
    shared: FrontEnd | None = None
    for method in methods:
        if method.model == "none":
            yield run_front_end(recording, config.with_gps("none"), progress), method
            continue
        shared = shared or run_front_end(recording, config, progress)
        yield shared, method


def _placed(solution: Solution, true: Trajectory) -> Solution:
    """Moved, turned and scaled so that the first frames lie where they truly were."""
    e, t = match_times(solution.t_s, true.t_s, float(np.median(np.diff(solution.t_s))) / 2)
    e, t = e[:_FIRST_FRAMES], t[:_FIRST_FRAMES]
    if len(e) < 2:
        raise TrajectoryError("the truth has fewer than two of the first frames", expected=f"{_FIRST_FRAMES}")
    found, wanted = solution.world_T_camera[e], true.world_T_camera[t]
    way = [np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum() for poses in (found, wanted)]
    R = Rotation.from_matrix(wanted[:, :3, :3] @ found[:, :3, :3].transpose(0, 2, 1)).mean().as_matrix()
    scale = float(way[1] / max(way[0], 1e-12))
    poses = solution.world_T_camera.copy()
    poses[:, :3, :3] = R @ poses[:, :3, :3]
    shift = wanted[:, :3, 3].mean(axis=0) - scale * R @ found[:, :3, 3].mean(axis=0)
    poses[:, :3, 3] = scale * poses[:, :3, 3] @ R.T + shift
    sigma = scale * solution.sigma_position_m
    return replace(solution, georeferenced=True, world_T_camera=poses, sigma_position_m=sigma)


def check_world(found: GeodeticPoint | None, true: GeodeticPoint | None, truth: Path) -> None:
    """Raise TrajectoryError where a run and its truth are not in the same ENU."""
    if found is not None and true is not None and not np.allclose(found, true, rtol=0, atol=1e-9):
        raise TrajectoryError(
            "the truth's world_origin is not the recording's",
            file=truth,
            remedy="give the same world_origin in both rig.yaml",
        )
