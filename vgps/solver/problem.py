"""The optimisation problem of stages C and D: poses, landmarks, observations, and GTSAM factors on poses.

Observations are arrays rather than factors, so that a solver can linearise all of them at once.
:mod:`vgps.solver.cost` evaluates the problem; :func:`vgps.solver.gtsam_graphs.gtsam_export.to_graph` writes
it as a GTSAM factor graph whose ``error`` equals that cost up to rounding.
"""

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Literal

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solver.mounts import CameraMounts
from vgps.solver.row_times import RowTimes
from vgps.solver.state_vectors import MAX_STATE_SIZE, StateVector

RobustLoss = Literal["none", "huber", "cauchy"]


@dataclass(frozen=True, kw_only=True)
class BundleProblem:
    """Poses and landmarks to estimate, the observations of the landmarks, and all other factors on poses.

    The cost is ``sum rho(|uv - uv^| / sigma_px) + pose_graph.error``, Eq. (11), Kume 2010, with
    ``rho(e) = e^2 / 2`` or a robust loss; ``sigma_px`` contains the reliability and the 1/|P_i| of
    Eq. (12)(13).

    Attributes:
        K: fx, fy, cx, cy of the undistorted image, pixels.
        world_T_camera: (F, 4, 4); chronological order keeps the reduced matrix narrow.
        world_p_landmark: (L, 3) metres.
        frame, landmark: (N,) frame and landmark of each observation; a pair occurs at most once.
        uv_px: (N, 2) observed position in the undistorted image.
        sigma_px: (N,) standard deviation of each of the two coordinates, in pixels of the picture.
        robust: Loss of the whitened error ``|uv - uv^| / sigma_px``.
        robust_k: (N,) constant of the loss for whitened errors (:func:`vgps.solver.cost.whitened_robust_k`);
            inf means quadratic. Required unless ``robust`` is ``none``.
        pose_graph: Factors whose keys are those of poses, of ``shared`` or of ``states``.
        fixed: (F,) frames whose poses are held constant; None means none.
        shared: Vectors (d,) that all frames share, such as a time offset or a lever arm, by their key; each
            occurs in ``pose_graph``. They are a dense border of the reduced matrix: few coordinates.
        states: Vectors that belong to a place in the video, by their key; each occurs in ``pose_graph``. The
            cost grows linearly with their number.
        pose_keys: (F,) distinct keys of the poses in ``pose_graph``; None means ``x<frame>``.
        lens: (N, 2, 2) from :mod:`vgps.lens_jacobian`, by which errors are those of the picture that
            features were found in; None for a pinhole.
        row_times: Times (N,) of the observations, for a rolling shutter.
        submap_frames: Frames of a submap, if the problem is to be solved in submaps on disk.
        mounts: Cameras (N,) of the observations, for a rig of several; ``K`` is that of the first.

    Raises:
        ValueError: Shapes or indices are inconsistent, a sigma is not positive, or a key is used twice.
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
    states: Mapping[int, StateVector] = field(default_factory=dict)
    pose_keys: IntArray | None = None
    lens: FloatArray | None = None
    row_times: RowTimes | None = None
    submap_frames: int | None = None
    mounts: CameraMounts | None = None

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
        if self.lens is not None:
            shapes["lens"] = (self.lens.shape, (n, 2, 2))
        if self.row_times is not None:
            shapes["row_times"] = (self.row_times.share.shape, (n,))
        if self.mounts is not None:
            shapes["mounts"] = (self.mounts.camera.shape, (n,))
        for name, (found, expected) in shapes.items():
            if found != expected:
                raise ValueError(f"{name} has shape {found}, expected {expected}")
        _check_range("frame", self.frame, frames)
        _check_range("landmark", self.landmark, landmarks)
        if not np.all(self.sigma_px > 0.0):
            raise ValueError(f"smallest sigma_px is {self.sigma_px.min()}, expected positive pixels")
        self._check_states()

    def _check_states(self) -> None:
        after = np.array([state.frame for state in self.states.values()], dtype=np.int64)
        _check_range("frame of a state", after, len(self.world_T_camera))
        for key, state in self.states.items():
            if state.vector.ndim != 1 or not 1 <= len(state.vector) <= MAX_STATE_SIZE:
                found = f"state {gtsam.DefaultKeyFormatter(key)} has shape {state.vector.shape}"
                raise ValueError(f"{found}, expected (d,) with d of 1..{MAX_STATE_SIZE}")
        twice = self.states.keys() & {*self.shared, *(self.keys.tolist() if self.states else ())}
        if twice:
            raise ValueError(f"key {gtsam.DefaultKeyFormatter(min(twice))} belongs to a state and to another")

    @property
    def fixed_frames(self) -> BoolArray:
        """(F,) frames whose poses are held constant."""
        return np.zeros(len(self.world_T_camera), dtype=bool) if self.fixed is None else self.fixed

    @property
    def keys(self) -> IntArray:
        """(F,) keys of the poses in ``pose_graph``."""
        if self.pose_keys is not None:
            return self.pose_keys
        return np.arange(len(self.world_T_camera), dtype=np.int64) + X(0)

    def frames_of(self, keys: Iterable[int]) -> IntArray:
        """Return the frames of the poses with these keys.

        Raises:
            ValueError: A key belongs to no pose.
        """
        wanted, pose_keys = np.array(list(keys), dtype=np.int64), self.keys
        if self.pose_keys is None:
            _check_range("frame of a pose factor", wanted - X(0), len(pose_keys))
            return wanted - X(0)
        order = np.argsort(pose_keys, kind="stable")
        at = np.searchsorted(pose_keys[order[:-1]], wanted)
        unknown = wanted[wanted != pose_keys[order][at]]
        if len(unknown):
            raise ValueError(f"key {gtsam.DefaultKeyFormatter(int(unknown[0]))} belongs to no pose")
        return np.asarray(order[at], np.int64)

    @property
    def pose_graph_frames(self) -> IntArray:
        """Frames that occur in ``pose_graph``, ascending.

        Raises:
            ValueError: A key belongs neither to a pose, nor to ``shared``, nor to ``states``.
        """
        vectors = {*self.shared, *self.states}
        return np.sort(self.frames_of(key for key in self.pose_graph.keyVector() if key not in vectors))

    def select_observations(self, rows: IntArray) -> "BundleProblem":
        """Return the problem with only these observations and without pose factors."""
        return replace(
            self,
            frame=self.frame[rows],
            landmark=self.landmark[rows],
            uv_px=self.uv_px[rows],
            sigma_px=self.sigma_px[rows],
            robust_k=None if self.robust_k is None else self.robust_k[rows],
            pose_graph=gtsam.NonlinearFactorGraph(),
            shared={},
            states={},
            lens=None if self.lens is None else self.lens[rows],
            row_times=None if self.row_times is None else self.row_times.rows(rows),
            mounts=None if self.mounts is None else self.mounts.rows(rows),
        )

    def moved(
        self,
        world_T_camera: FloatArray,
        world_p_landmark: FloatArray,
        shared: Mapping[int, FloatArray] | None = None,
        states: Mapping[int, StateVector] | None = None,
    ) -> "BundleProblem":
        """Return the problem at other poses (F, 4, 4), landmarks (L, 3), shared vectors and states."""
        moved = copy(self)  # not `replace`, which would validate the observations again
        changes = {"world_T_camera": world_T_camera, "world_p_landmark": world_p_landmark}
        for name, value in changes.items():
            if value.shape != getattr(self, name).shape:
                raise ValueError(f"{name} has shape {value.shape}, expected {getattr(self, name).shape}")
            object.__setattr__(moved, name, value)
        for name, vectors in {"shared": shared, "states": states}.items():
            if vectors is not None:
                object.__setattr__(moved, name, vectors)
        return moved

    @property
    def intrinsics(self) -> tuple[float | FloatArray, ...]:
        """fx, fy, cx, cy of the camera, or (N,) of each observation's camera."""
        return self.K if self.mounts is None else self.mounts.intrinsics

    def by_view(self) -> "BundleProblem":
        """Return the observations with a frame for each row's pose and each camera's; else itself."""
        if self.row_times is None and self.mounts is None:
            return self
        poses, frame, mounts = self.world_T_camera, self.frame, self.mounts
        if self.row_times is not None:
            poses, frame = self.row_times.poses(poses), np.arange(len(frame))
        if mounts is not None:
            poses, frame = mounts.views(poses, frame)
            mounts = replace(mounts, reference_T_camera=None)
        views = copy(self)
        changes = {"world_T_camera": poses, "frame": frame, "row_times": None, "mounts": mounts}
        for name, value in changes.items():
            object.__setattr__(views, name, value)
        return views


def _check_range(name: str, index: IntArray, size: int) -> None:
    if len(index) and (index.min() < 0 or index.max() >= size):
        raise ValueError(f"{name} {index.min()}..{index.max()}, expected 0..{size - 1}")
