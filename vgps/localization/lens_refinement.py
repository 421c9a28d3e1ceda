"""The calibration of a tracked camera, refined by the landmarks of the map that its frames show.

Landmarks are where the map's own cameras saw them. A focal length that is one per cent off does not fit them,
and moves every pose along the view; so poses and calibration that fit best are found by Gauss-Newton steps
with landmarks held. Errors of a landmark are the same in all frames, so the standard deviations are those of
steps from which one group of landmarks after the other is left out (the delete-a-group jackknife; Efron, The
Jackknife, the Bootstrap and Other Resampling Plans, 1982), if these are the larger ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from vgps.camera import distort, undistort
from vgps.config import Config
from vgps.geometry import linearise_projection
from vgps.localization.tracker import TrackedFrame
from vgps.model import Camera, CameraGuess, FloatArray, IntArray
from vgps.smoothing.calibration.camera_equations import calibration_jacobian, changed_camera, parameter_count
from vgps.smoothing.calibration.refined_camera import (
    CameraPrior,
    RefinedCamera,
    moved_from,
    prior_about,
    refined_with,
)

_FIRST_FRAMES = 60  # tracked ones, after which a calibration is looked at; again whenever they have doubled
_MOST_CHANGES = 3  # each brings matches that the calibration before it had lost
_GROUPS = 20  # of landmarks; standard deviations are then known to a sixth of themselves
_LEAST_INFORMATION = 1e-6  # of a pose: one that few matches hold may be anywhere within a kilometre


class LensCheck:
    """Whether the landmarks contradict a calibration, asked after every frame.

    Args:
        given: The calibration of the recording.
        guesses: What was assumed where none is given.
        config: Settings.

    Attributes:
        found: The calibration that it was changed to; None if it was not.
    """

    def __init__(self, given: Camera, guesses: Sequence[CameraGuess], config: Config) -> None:
        self._given, self._config = given, config
        self._prior = prior_about(given, config.intrinsics)
        if guesses:
            self._prior = CameraPrior(guesses[0].camera, guesses[0].sigmas)
        self._tracked, self._next, self._changes = 0, _FIRST_FRAMES, 0
        self.found: RefinedCamera | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """A warning if the calibration was changed."""
        return () if self.found is None else (f"{self.found.note(self._given)}, as the landmarks show",)

    def better(self, camera: Camera, frames: Sequence[TrackedFrame]) -> Camera | None:
        """Return the calibration that the landmarks show if it is not this one; mostly None.

        Args:
            camera: By which the frames are tracked, from the first one again after a change.
            frames: All so far.
        """
        self._tracked += frames[-1].tracked
        if self._tracked < self._next or self._changes == _MOST_CHANGES:
            return None
        self._next *= 2
        camera = self._prior.of_model(camera)
        found = refine_by_landmarks(camera, self._prior, frames, self._config)
        if found is None or not found.differs_from(camera):
            return None
        self._tracked, self._next, self._changes = 0, _FIRST_FRAMES, self._changes + 1
        self.found = found
        return found.camera


@dataclass(frozen=True)
class _Matches:
    """Matches of all tracked frames, in order of frames.

    Attributes:
        frame: (n,) tracked frame of each match.
        landmark: (n,) number of its landmark.
        world_p_landmark: (n, 3).
        raw_px: (n, 2) in the picture, distorted.
        sigma_px: (n,).
    """

    frame: IntArray
    landmark: IntArray
    world_p_landmark: FloatArray
    raw_px: FloatArray
    sigma_px: FloatArray


def refine_by_landmarks(
    camera: Camera, prior: CameraPrior, frames: Sequence[TrackedFrame], config: Config
) -> RefinedCamera | None:
    """Return the calibration that suits the landmarks best; None if they do not determine it.

    Args:
        camera: By which the matches were undistorted, of the prior's lens model.
        prior: Of the calibration.
        frames: Tracked ones count.
        config: Settings of the refinement, and Huber's constant.
    """
    tracked = [frame for frame in frames if frame.tracked]
    poses = np.array([frame.world_T_camera for frame in tracked])
    matches, settings = _joined(camera, tracked), config.intrinsics
    step, converged = 0, False
    while step < settings.iterations and not converged:
        step += 1
        equations = _linearise(camera, poses, matches, config.localization.huber_px)
        try:
            delta, sigma, moves = _solved(equations, prior, moved_from(camera, prior.mean))
        except np.linalg.LinAlgError:
            return None
        camera = changed_camera(camera, delta)
        poses = poses @ np.array([gtsam.Pose3.Expmap(move).matrix() for move in moves])
        converged = bool(np.all(np.abs(delta) < settings.tolerance_sigmas * sigma))
    return refined_with(camera, sigma, step, converged)


def _joined(camera: Camera, frames: Sequence[TrackedFrame]) -> _Matches:
    parts = [frame.observations for frame in frames]
    _, landmark = np.unique(np.concatenate([part.landmark for part in parts]), return_inverse=True)
    return _Matches(
        frame=np.repeat(np.arange(len(parts)), [len(part) for part in parts]),
        landmark=landmark,
        world_p_landmark=np.concatenate([part.world_p_landmark for part in parts]),
        raw_px=distort(camera, np.concatenate([part.uv_px for part in parts])),
        sigma_px=np.concatenate([part.sigma_px for part in parts]),
    )


def _linearise(camera: Camera, poses: FloatArray, matches: _Matches, huber_px: float) -> FloatArray:
    """Return normal equations (F, G, 7 + p, 7 + p) of each frame and group of landmarks.

    Of the frame's pose, the p parameters of the calibration, and the right-hand side.
    """
    uv_px = undistort(camera, matches.raw_px)
    first = np.flatnonzero(np.diff(matches.frame, prepend=-1))
    rows = [slice(*ends) for ends in zip(first, [*first[1:], len(uv_px)], strict=True)]
    parts = [
        linearise_projection(camera.K, pose, matches.world_p_landmark[row], uv_px[row])
        for pose, row in zip(poses, rows, strict=True)
    ]
    r, by_pose = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    rays = (r + uv_px - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    by_camera = calibration_jacobian(camera, rays.T, uv_px, parameter_count(camera))
    weight = np.sqrt(np.minimum(1.0, huber_px / np.maximum(np.linalg.norm(r, axis=1), 1e-12)))
    J = np.concatenate([by_pose, by_camera.transpose(2, 1, 0), r[..., None]], axis=2)
    J *= (weight / matches.sigma_px)[:, None, None]
    place = matches.frame * _GROUPS + matches.landmark % _GROUPS
    sums = _sums(J.transpose(0, 2, 1) @ J, place, len(poses) * _GROUPS)
    return sums.reshape(len(poses), _GROUPS, *sums.shape[1:])


def _sums(values: FloatArray, place: IntArray, count: int) -> FloatArray:
    """Return the sums (count, ...) of values (n, ...) by their places (n,)."""
    order = np.argsort(place, kind="stable")
    found, first = np.unique(place[order], return_index=True)
    sums = np.zeros((count, *values.shape[1:]))
    sums[found] = np.add.reduceat(values[order], first)
    return sums


def _solved(
    equations: FloatArray, prior: CameraPrior, moved: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the step (p,) of the calibration, its standard deviations (p,), and the poses' steps (F, 6).

    Args:
        equations: (F, G, 7 + p, 7 + p) from :func:`_linearise`.
        prior: Of the calibration.
        moved: (p,) from its mean.
    """
    total = equations.sum(axis=1)
    delta, covariance, moves = _step(total, prior, moved)
    without = [_step(total - group, prior, moved)[0] for group in equations.swapaxes(0, 1)]
    jackknife = (_GROUPS - 1) * np.var(without, axis=0)
    return delta, np.sqrt(np.maximum(np.diagonal(covariance), jackknife)), moves


def _step(
    equations: FloatArray, prior: CameraPrior, moved: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the step (p,) of the calibration, its covariance (p, p), and the poses' steps (F, 6)."""
    A, B = equations[:, :6, :6] + _LEAST_INFORMATION * np.eye(6), equations[:, :6, 6:]
    follow = np.linalg.solve(A, B)  # (F, 6, p + 1)
    normal = (equations[:, 6:, 6:] - B.transpose(0, 2, 1) @ follow).sum(axis=0)
    precision = prior.sigma[: len(moved)] ** -2.0
    covariance = np.linalg.inv(normal[:-1, :-1] + np.diag(precision))
    delta = -covariance @ (normal[:-1, -1] + precision * moved)
    return delta, covariance, -(follow[..., :-1] @ delta + follow[..., -1])
