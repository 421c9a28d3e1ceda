"""The problem of a round of stage D, built from plain data: by stage D itself, and again from a run."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import gtsam
import numpy as np

from vgps.gps.fixes import Fixes
from vgps.gps.learned_errors import LearnedErrors, with_errors
from vgps.gps.offsets import GpsTerm, gps_term, offset_key
from vgps.gps.sensors import Sensors
from vgps.imu.factors import imu_graph
from vgps.imu.states import ImuStates
from vgps.model import BoolArray, FixClass, FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.control_factors import control_factors
from vgps.smoothing.scene.factor_graph import build_problem, joined, other_pose_factors
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.imu_states import imu_state_vectors
from vgps.solver.problem import BundleProblem
from vgps.solver.state_vectors import StateVector


@dataclass(frozen=True, kw_only=True)
class BatchInput:
    """Input of a problem of stage D.

    Attributes:
        scene: Frames, features and the observations used.
        sigma_px: (L,) reliabilities of the features; NaN for deselected ones, which have no observations.
        control_sigma_px: (C,) standard deviations of the observed control points, pixels.
        fixes: Fixes with their verdicts applied and their time offset removed.
        sensors: Time offset that was removed, lever arm, and their priors.
        fixed: (F,) frames to hold; None means none.
        context: Camera, IMU and settings, with the current weight of the video.
        imu: Velocities and biases; None without an IMU.
        antenna_velocity: (M, 3) m/s at the fixes, by which they move with a time offset that is estimated.
    """

    scene: Scene
    sigma_px: FloatArray
    control_sigma_px: FloatArray
    fixes: Fixes
    sensors: Sensors
    fixed: BoolArray | None
    context: SmoothingContext
    errors: Mapping[FixClass, LearnedErrors] = field(default_factory=dict)
    imu: ImuStates | None = None
    antenna_velocity: FloatArray | None = None


@dataclass(frozen=True)
class BatchProblem:
    """A problem of stage D, and its factors that errors of fixes and of everything else enter.

    Attributes:
        problem: The problem.
        gps: Its GPS term.
        other_factors: All factors but the projections and the GPS term.
    """

    problem: BundleProblem
    gps: GpsTerm
    other_factors: gtsam.NonlinearFactorGraph


def batch_problem(given: BatchInput, n: int | None = None, loose: bool = False) -> BatchProblem:
    """Return the energy (11) of Kume 2010 over all frames.

    Args:
        given: Frames, features, fixes, sensors and settings.
        n: Exponent of the GPS walls, if not the configured one.
        loose: Whether the offsets of fixes are bounded loosely, as in :func:`vgps.gps.offsets.gps_term`.
    """
    scene, sensors, context = given.scene, given.sensors, given.context
    config = with_errors(context.config.gps, given.errors)
    term = gps_term(given.fixes, scene.trajectory, sensors, config, n, loose, given.antenna_velocity)
    others = other_pose_factors(scene, sensors, context.config, given.imu)
    others.push_back(control_factors(scene.controls, given.control_sigma_px, context.K))
    states = _offset_states(term)
    if given.imu is not None and context.imu is not None:
        others.push_back(imu_graph(context.imu, given.imu, scene.t_s, context.config.imu))
        states |= imu_state_vectors(given.imu)
    graph = joined(term.bounds, term.noise, others)
    problem = build_problem(scene, np.nan_to_num(given.sigma_px, nan=1.0), graph, context, given.fixed)
    submap_frames = context.config.submaps.frames_of(len(scene.t_s))
    shared = sensors.shared() | ({} if scene.heights is None else scene.heights.shared())
    problem = replace(problem, shared=shared, states=states, submap_frames=submap_frames)
    return BatchProblem(problem, term, others)


def _offset_states(term: GpsTerm) -> dict[int, StateVector]:
    """Return the offsets of a GPS term as states of a problem, by their keys."""
    places = zip(term.offsets, term.offset_frames.tolist(), strict=True)
    return {offset_key(k): StateVector(offset, frame) for k, (offset, frame) in enumerate(places)}
