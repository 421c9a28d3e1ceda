"""COLMAP on vgps's problems: bundle adjustment with position priors, and mapping from images.

Needs the ``bench`` extra (pycolmap). COLMAP has no lever arm and no weight per observation; the problems here
need neither.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pycolmap

from scripts.common.colmap_problem import Priors
from scripts.common.stopwatch import stopwatch
from vgps.model import Camera, FloatArray, Recording
from vgps.solution import Trajectory
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.cost import cost_terms
from vgps.solver.problem import BundleProblem
from vgps.writers.colmap import IMAGE_NAME, colmap_camera

_FAR_M = 1e3  # COLMAP first aligns the model with the priors by RANSAC: none of them is to be an outlier


@dataclass(frozen=True)
class AdjustmentResult:
    """Result of an optimiser: the problem at its end, iterations, wall and processor seconds."""

    problem: BundleProblem
    iterations: int
    wall_s: float
    cpu_s: float


Engine = Callable[[int, float], AdjustmentResult]  # of the most iterations and the tolerance


def by_vgps(problem: BundleProblem, max_iterations: int, tolerance: float) -> AdjustmentResult:
    """Solve by vgps; as :func:`adjust`."""
    settings = SolverSettings(max_iterations=max_iterations, relative_tolerance=tolerance)
    with stopwatch() as elapsed:
        result = solve(problem, settings)
    return AdjustmentResult(result.problem, result.report.iterations, elapsed.wall_s, elapsed.cpu_s)


def cost_of(result: AdjustmentResult) -> float:
    """Return vgps's cost of where an engine ended."""
    return sum(cost_terms(result.problem).values())


def adjust(
    problem: BundleProblem,
    priors: Priors,
    camera: Camera,
    threads: int,
    max_iterations: int,
    tolerance: float,
    *,
    robust: bool | None = None,
) -> AdjustmentResult:
    """Run COLMAP's pose-prior bundle adjustment with the camera's calibration held.

    Args:
        problem: The start; one ``sigma_px`` for all observations.
        priors: Those of its ``pose_graph``.
        camera: Gives the size of its images.
        threads: Of Ceres.
        max_iterations: Ends after so many.
        tolerance: Ends once a step lowers the cost by no more than this share of it.
        robust: For wrong priors: COLMAP chooses those that it aligns the model with, and its loss is Cauchy
            (true) or none, its default (false). None takes all priors to be right.
    """
    sigma_px = float(problem.sigma_px[0])
    model = as_reconstruction(problem, camera)
    options = _options(threads, max_iterations, tolerance)
    prior_options = pycolmap.PosePriorBundleAdjustmentOptions()
    if robust is None:
        prior_options.alignment_ransac.max_error = _FAR_M
    elif robust:
        prior_options.ceres.prior_position_loss_function_type = pycolmap.LossFunctionType.CAUCHY
    prior_options.alignment_ransac.random_seed = 0
    config = pycolmap.BundleAdjustmentConfig()
    for image in model.reg_image_ids():
        config.add_image(image)
    # COLMAP's pixels have a sigma of 1: sigmas in metres are divided by what its unit stands for
    poses = [_prior(model.image(int(f) + 1).data_id, p, s / sigma_px) for f, p, s in _rows(priors)]
    with stopwatch() as elapsed:
        adjuster = pycolmap.create_pose_prior_bundle_adjuster(options, prior_options, config, poses, model)
        report = adjuster.solve().brief_report()
    found = re.search(r"Iterations: (\d+)", report)
    if found is None:
        raise RuntimeError(f"no number of iterations in COLMAP's report: {report}")
    steps = int(found[1]) - 1  # Ceres counts the evaluation of the start
    return AdjustmentResult(solved(problem, model), steps, elapsed.wall_s, elapsed.cpu_s)


def _options(threads: int, max_iterations: int, tolerance: float) -> pycolmap.BundleAdjustmentOptions:
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_extra_params = options.print_summary = False
    solver = options.ceres.solver_options
    solver.num_threads, solver.max_num_iterations = threads, max_iterations
    solver.function_tolerance = tolerance
    options.ceres.min_num_residuals_for_cpu_multi_threading = 0  # as many threads as asked for, always
    # its iterative solver, the default beyond 1,000 images, takes four times as long on a path with loops
    options.ceres.max_num_images_direct_sparse_cpu_solver = 10_000
    return options


def as_reconstruction(problem: BundleProblem, camera: Camera) -> pycolmap.Reconstruction:
    """Return a problem as COLMAP's model, undistorted: image f + 1 is frame f, point j + 1 landmark j."""
    model = pycolmap.Reconstruction()
    size = {"width": camera.width, "height": camera.height}
    model.add_camera_with_trivial_rig(pycolmap.Camera(model="PINHOLE", params=problem.K, camera_id=1, **size))
    place = np.empty(len(problem.frame), np.int64)  # of an observation among those of its image
    for f, camera_T_world in enumerate(np.linalg.inv(problem.world_T_camera)):
        seen = np.flatnonzero(problem.frame == f)
        place[seen] = np.arange(len(seen))
        image = pycolmap.Image(IMAGE_NAME.format(f), problem.uv_px[seen], camera_id=1, image_id=f + 1)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(camera_T_world[:3]))
    order = np.argsort(problem.landmark, kind="stable")
    ends = np.cumsum(np.bincount(problem.landmark, minlength=len(problem.world_p_landmark)))
    for rows, point in zip(np.split(order, ends[:-1]), problem.world_p_landmark, strict=True):
        seen_in = zip((problem.frame[rows] + 1).tolist(), place[rows].tolist(), strict=True)
        model.add_point3D(point, pycolmap.Track([pycolmap.TrackElement(*pair) for pair in seen_in]))
    return model


def _rows(priors: Priors) -> list[tuple[int, FloatArray, FloatArray]]:
    return list(zip(priors.frame.tolist(), priors.world_p_camera, priors.sigma_m, strict=True))


def _prior(data: pycolmap.data_t, position: FloatArray, sigma_m: FloatArray) -> pycolmap.PosePrior:
    return pycolmap.PosePrior(
        corr_data_id=data,
        position=position,
        position_covariance=np.diag(sigma_m**2),
        coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
    )


def solved(problem: BundleProblem, model: pycolmap.Reconstruction) -> BundleProblem:
    """Return a problem at the poses and points of a model from :func:`as_reconstruction`."""
    poses, points = problem.world_T_camera.copy(), problem.world_p_landmark.copy()
    for f in range(len(poses)):
        poses[f, :3] = model.image(f + 1).cam_from_world().inverse().matrix()
    for j, point in model.points3D.items():
        points[j - 1] = point.xyz
    return problem.moved(poses, points)


def map_images(
    recording: Recording, every: int, limit: int | None, priors: Priors | None, seed: int
) -> tuple[Trajectory, dict[str, float]]:
    """Run COLMAP's feature extraction, sequential matching and mapping on every n-th frame.

    Args:
        recording: Its video and camera, whose calibration is held.
        every: Take every n-th frame.
        limit: Take so many at most; None for all.
        priors: One per fix, at frames that are taken; None for no priors.
        seed: Of COLMAP's random numbers.

    Returns:
        Poses of the frames of its largest model, in the priors' world if any; wall seconds per step.
    """
    seconds: dict[str, float] = {}
    with TemporaryDirectory() as scratch:
        images, database = Path(scratch) / "images", Path(scratch) / "database.db"
        images.mkdir()
        _save(recording, every, limit, images)
        name, parameters = colmap_camera(recording.camera)
        reader = pycolmap.ImageReaderOptions(
            camera_model=name, camera_params=",".join(f"{x:.17g}" for x in parameters)
        )
        single = pycolmap.CameraMode.SINGLE
        pycolmap.set_random_seed(seed)
        with stopwatch() as elapsed:
            pycolmap.extract_features(database, images, camera_mode=single, reader_options=reader)
        seconds["features"] = elapsed.wall_s
        if priors is not None:
            _write_priors(database, priors)
        with stopwatch() as elapsed:
            pycolmap.match_sequential(database)
        seconds["matching"] = elapsed.wall_s
        options = pycolmap.IncrementalPipelineOptions()
        options.use_prior_position, options.random_seed = priors is not None, seed
        options.ba_refine_focal_length = options.ba_refine_extra_params = False
        with stopwatch() as elapsed:
            models = pycolmap.incremental_mapping(database, images, scratch, options)
        seconds["mapping"] = elapsed.wall_s
    best = max(models.values(), key=lambda model: model.num_reg_images(), default=None)
    return _trajectory(best, recording.video.times_s), seconds


def _save(recording: Recording, every: int, limit: int | None, folder: Path) -> None:
    for frame in recording.video.frames():
        if limit is not None and frame.index >= every * limit:
            return
        if frame.index % every == 0:
            # without loss: names as in the exported model, whatever they end in
            cv2.imwrite(str(folder / IMAGE_NAME.format(frame.index).replace(".jpg", ".png")), frame.gray)


def _write_priors(database: Path, priors: Priors) -> None:
    with pycolmap.Database.open(database) as store:
        by_frame = {int(re.sub(r"\D", "", image.name)): image for image in store.read_all_images()}
        for frame, position, sigma in _rows(priors):
            if frame in by_frame:
                store.write_pose_prior(_prior(by_frame[frame].data_id, position, sigma))


def _trajectory(model: pycolmap.Reconstruction | None, times_s: FloatArray) -> Trajectory:
    if model is None:
        return Trajectory(np.empty(0), np.empty((0, 4, 4)))
    images = sorted(model.images.values(), key=lambda image: image.name)
    frames = [int(re.sub(r"\D", "", image.name)) for image in images if image.has_pose]
    poses = np.tile(np.eye(4), (len(frames), 1, 1))
    poses[:, :3] = [image.cam_from_world().inverse().matrix() for image in images if image.has_pose]
    return Trajectory(times_s[frames], poses)
