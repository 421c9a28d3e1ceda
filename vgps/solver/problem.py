"""The optimisation problem of stages C and D: poses, landmarks, observations, and GTSAM factors on poses.

Observations are arrays, never factors: a solver linearises them all at once. ``bundle_graph`` writes the same
problem as a GTSAM factor graph, whose ``error`` is this module's cost to the last digits.
"""

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Literal

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.model import BoolArray, FloatArray, IntArray

RobustLoss = Literal["none", "huber", "cauchy"]


@dataclass(frozen=True)
class BundleProblem:
    """Poses and points to be estimated, what was seen of them, and every other factor on the poses.

    The cost is ``sum rho(|uv - uv^| / sigma_px) + pose_graph.error``, Eq. (11), Kume 2010, with ``sigma_px``
    carrying the reliability and the 1/|P_i| of Eq. (12)(13): ``rho(e) = e^2 / 2`` or a robust loss.

    Attributes:
        K: fx, fy, cx, cy of the undistorted image, pixels.
        world_T_camera: (F, 4, 4), in order of time; key ``x<frame>`` in ``pose_graph``, or of ``pose_keys``.
        world_p_landmark: (L, 3) metres; key ``l<row>``.
        frame, landmark: (N,) which landmark was seen in which frame; a pair occurs at most once.
        uv_px: (N, 2) where, in the undistorted image.
        sigma_px: (N,) standard deviation of each of the two coordinates.
        robust: Loss of the whitened error ``|uv - uv^| / sigma_px``.
        robust_k: (N,) its constant, whitened (:func:`whitened_robust_k`); inf means quadratic. Needed unless
            ``robust`` is ``none``.
        pose_graph: Factors whose keys are those of poses or of ``shared``.
        shared: Vectors (d,) that all frames share, a clock's lag or a lever arm, by their key in
            ``pose_graph``; every one occurs there.
        fixed: (F,) frames whose poses are held; absent means none.
        pose_keys: (F,) keys of the poses, each once; absent means ``x<frame>``.

    Raises:
        ValueError: Shapes or indices do not fit each other.
    """

    K: tuple[float, float, float, float]
    world_T_camera: FloatArray
    world_p_landmark: FloatArray
    frame: IntArray
    landmark: IntArray
    uv_px: FloatArray
    sigma_px: FloatArray
    robust: RobustLoss = "none"
    robust_k: FloatArray | None = None
    pose_graph: gtsam.NonlinearFactorGraph = field(default_factory=gtsam.NonlinearFactorGraph)
    fixed: BoolArray | None = None
    shared: Mapping[int, FloatArray] = field(default_factory=dict)
    pose_keys: IntArray | None = None

    def __post_init__(self) -> None:
        n, frames, landmarks = len(self.frame), len(self.world_T_camera), len(self.world_p_landmark)
        shapes = {
            "K": (np.shape(self.K), (4,)),
            "world_T_camera": (self.world_T_camera.shape, (frames, 4, 4)),
            "world_p_landmark": (self.world_p_landmark.shape, (landmarks, 3)),
            "landmark": (self.landmark.shape, (n,)),
            "uv_px": (self.uv_px.shape, (n, 2)),
            "sigma_px": (self.sigma_px.shape, (n,)),
            "fixed": (self.fixed_frames.shape, (frames,)),
            "pose_keys": (self.keys.shape, (frames,)),
        }
        if self.robust_k is not None or self.robust != "none":
            shapes["robust_k"] = (() if self.robust_k is None else self.robust_k.shape, (n,))
        for name, (found, expected) in shapes.items():
            if found != expected:
                raise ValueError(f"{name} has shape {found}, expected {expected}")
        _check_range("frame", self.frame, frames)
        _check_range("landmark", self.landmark, landmarks)
        if not np.all(self.sigma_px > 0.0):
            raise ValueError("sigma_px must be positive")

    @property
    def fixed_frames(self) -> BoolArray:
        """(F,) frames whose poses are held, none if ``fixed`` is absent."""
        return np.zeros(len(self.world_T_camera), dtype=bool) if self.fixed is None else self.fixed

    @property
    def keys(self) -> IntArray:
        """(F,) keys of the poses in GTSAM."""
        if self.pose_keys is not None:
            return self.pose_keys
        return np.arange(len(self.world_T_camera), dtype=np.int64) + X(0)

    def frames_of(self, keys: Iterable[int]) -> IntArray:
        """Frames of the poses with these keys.

        Raises:
            ValueError: One is no pose's.
        """
        wanted, own = np.array(list(keys), dtype=np.int64), self.keys
        if self.pose_keys is None:
            _check_range("frame of a pose factor", wanted - X(0), len(own))
            return wanted - X(0)
        order = np.argsort(own, kind="stable")
        at = np.searchsorted(own[order[:-1]], wanted)
        strange = wanted[wanted != own[order][at]]
        if len(strange):
            raise ValueError(f"the key {gtsam.DefaultKeyFormatter(int(strange[0]))} is no pose's")
        return np.asarray(order[at], np.int64)

    def only(self, rows: IntArray) -> "BundleProblem":
        """The same problem cut down to some observations, without pose factors."""
        return replace(
            self,
            frame=self.frame[rows],
            landmark=self.landmark[rows],
            uv_px=self.uv_px[rows],
            sigma_px=self.sigma_px[rows],
            robust_k=None if self.robust_k is None else self.robust_k[rows],
            pose_graph=gtsam.NonlinearFactorGraph(),
            shared={},
        )

    def moved(
        self,
        world_T_camera: FloatArray,
        world_p_landmark: FloatArray,
        shared: Mapping[int, FloatArray] | None = None,
    ) -> "BundleProblem":
        """The same problem at other poses (F, 4, 4), points (L, 3) and shared vectors."""
        twin = copy(self)  # the observations were looked through once
        changes = {"world_T_camera": world_T_camera, "world_p_landmark": world_p_landmark}
        for name, value in changes.items():
            if value.shape != getattr(self, name).shape:
                raise ValueError(f"{name} has shape {value.shape}, expected {getattr(self, name).shape}")
            object.__setattr__(twin, name, value)
        if shared is not None:
            object.__setattr__(twin, "shared", shared)
        return twin

    @property
    def pose_graph_frames(self) -> IntArray:
        """Frames that occur in ``pose_graph``, ascending.

        Raises:
            ValueError: A key is neither a pose's nor shared.
        """
        own = [key for key in self.pose_graph.keyVector() if key not in self.shared]
        return np.sort(self.frames_of(own))


def _check_range(name: str, index: IntArray, size: int) -> None:
    if len(index) and (index.min() < 0 or index.max() >= size):
        raise ValueError(f"{name} {index.min()}..{index.max()}, expected 0..{size - 1}")


def whitened_robust_k(k: float, pixel_sigma_px: FloatArray, sigma_px: FloatArray) -> FloatArray:
    """The constants that make a loss of the pixel error act as meant before the 1/|P_i| scaling.

    The weight shall depend on ``|e| / pixel_sigma_px`` against ``k``; the solver compares ``|e| / sigma_px``
    with the constant, so the constant is ``k * pixel_sigma_px / sigma_px``.

    Args:
        k: Constant for errors in units of ``pixel_sigma_px``.
        pixel_sigma_px: (N,) sigma of the measurement itself, pixels.
        sigma_px: (N,) sigma in the cost.
    """
    return k * pixel_sigma_px / sigma_px


def robust_loss(problem: BundleProblem, squared: FloatArray) -> FloatArray:
    """Loss rho of each observation, GTSAM's ``mEstimator.Huber`` and ``Cauchy``.

    Args:
        problem: Which loss, which constants.
        squared: (N,) squared whitened errors.
    """
    loss = 0.5 * squared
    if problem.robust == "none" or problem.robust_k is None:
        return loss
    k = problem.robust_k
    if problem.robust == "huber":
        beyond = squared > k * k
        loss[beyond] = k[beyond] * (np.sqrt(squared[beyond]) - 0.5 * k[beyond])
    else:
        finite = np.isfinite(k)
        k2 = k[finite] ** 2
        loss[finite] = 0.5 * k2 * np.log1p(squared[finite] / k2)
    return loss


def robust_weight(problem: BundleProblem, squared: FloatArray) -> FloatArray:
    """Weight rho'(e) / e of each observation in iteratively reweighted least squares.

    Args:
        problem: Which loss, which constants.
        squared: (N,) squared whitened errors.
    """
    weight = np.ones_like(squared)
    if problem.robust == "none" or problem.robust_k is None:
        return weight
    k = problem.robust_k
    if problem.robust == "huber":
        beyond = squared > k * k
        weight[beyond] = k[beyond] / np.sqrt(squared[beyond])
    else:
        finite = np.isfinite(k)
        weight[finite] = 1.0 / (1.0 + squared[finite] / k[finite] ** 2)
    return weight


def camera_points(problem: BundleProblem) -> FloatArray:
    """(3, N) every observation's landmark in its frame's camera axes, metres."""
    T, frame = problem.world_T_camera, problem.frame
    x, y, z = (problem.world_p_landmark[:, i][problem.landmark] - T[:, i, 3][frame] for i in range(3))
    return np.stack([T[:, 0, j][frame] * x + T[:, 1, j][frame] * y + T[:, 2, j][frame] * z for j in range(3)])


def residuals(problem: BundleProblem, camera_p: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Projected minus measured pixels (2, N), and which points lie behind the camera.

    A point behind has GTSAM's constant residual, twice the focal length in both coordinates.

    Args:
        problem: The measurements.
        camera_p: (3, N) of :func:`camera_points`.
    """
    fx, fy, cx, cy = problem.K
    x, y, z = camera_p
    behind = z <= 0.0
    depth = np.where(behind, 1.0, z)
    errors = np.stack(
        [fx * x / depth + (cx - problem.uv_px[:, 0]), fy * y / depth + (cy - problem.uv_px[:, 1])]
    )
    errors[:, behind] = 2.0 * fx
    return errors, behind


def projection_errors(problem: BundleProblem) -> tuple[FloatArray, BoolArray]:
    """Projected minus measured pixels (N, 2), and (N,) which points lie behind the camera."""
    errors, behind = residuals(problem, camera_points(problem))
    return errors.T, behind


def observation_costs(problem: BundleProblem) -> FloatArray:
    """(N,) each observation's part of the cost."""
    errors, _ = residuals(problem, camera_points(problem))
    return robust_loss(problem, np.sum(errors**2, axis=0) / problem.sigma_px**2)


def video_cost(problem: BundleProblem) -> float:
    """The observations' part of the cost, the sum of Phi_i of Eq. (12), Kume 2010."""
    return float(np.sum(observation_costs(problem)))


def pose_values(problem: BundleProblem) -> gtsam.Values:
    """The poses and shared vectors that occur in ``pose_graph``."""
    values = _shared_values(problem)
    frames = problem.pose_graph_frames
    for key, frame in zip(problem.keys[frames].tolist(), frames.tolist(), strict=True):
        values.insert(key, gtsam.Pose3(problem.world_T_camera[frame]))
    return values


def all_pose_values(problem: BundleProblem) -> gtsam.Values:
    """Every pose, whether or not a pose factor has it, and the shared vectors."""
    values = _shared_values(problem)
    for key, world_T_camera in zip(problem.keys.tolist(), problem.world_T_camera, strict=True):
        values.insert(key, gtsam.Pose3(world_T_camera))
    return values


def _shared_values(problem: BundleProblem) -> gtsam.Values:
    values = gtsam.Values()
    for key, vector in problem.shared.items():
        values.insert(key, vector)
    return values


def cost_terms(problem: BundleProblem) -> Mapping[str, float]:
    """The cost, Eq. (11), Kume 2010: ``video`` of the observations, ``poses`` of the pose factors."""
    return {"video": video_cost(problem), "poses": float(problem.pose_graph.error(pose_values(problem)))}
