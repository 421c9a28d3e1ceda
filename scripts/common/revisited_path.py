"""A bundle problem along a path that revisits places, its landmarks observed as a front end observes them."""

from collections.abc import Iterator
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.linalg import norm
from scipy.spatial import KDTree

from scripts.common.colmap_problem import Priors
from vgps.geometry import project
from vgps.model import BoolArray, Camera, FloatArray, IntArray
from vgps.solver.problem import BundleProblem

# the camera of KITTI odometry 00
CAMERA = Camera(model="pinhole", width=1241, height=376, fx=718.856, fy=718.856, cx=607.193, cy=185.216)
_CAMERA_HEIGHT_M = 1.65
_WALL_M = (4.0, 12.0)  # distance of the walls on either side
_NEAR_M, _FAR_M = 4.0, 60.0
_TURN_AS_M = 3.0 / np.radians(10.0)  # a keyframe after as many metres, or a turn that counts as much
_SIZE = (0.6, 2.0)  # size of a landmark in an image relative to the first, within which it is found
_MAX_ANGLE = np.radians(60.0)  # between the rays from which it is found
_PAUSE = 20  # keyframes without a view of it that end a visit
_FOUND_AGAIN = 0.5  # share of the visits after the first in which it is found
_PIXEL_SIGMA_PX, _FIX_SIGMA_M, _FIX_EVERY = 0.5, 0.1, 4
_START_SIGMA = (0.002, 0.002, 0.002, 0.1, 0.1, 0.1)  # rad, m
_START_DEPTH_SIGMA = 0.02  # relative
_CANDIDATES = 2  # landmarks placed for each that is kept
_AT_ONCE = 20_000  # landmarks whose views are computed at a time


@dataclass(frozen=True)
class ProblemSize:
    """Numbers of keyframes, landmarks and observations."""

    frames: int
    landmarks: int
    observations: int


def simulate_problem(poses: FloatArray, size: ProblemSize, seed: int = 0) -> tuple[BundleProblem, Priors]:
    """Return a problem of exactly this size at a start that is off, and the priors in its pose graph.

    Args:
        poses: (P, 4, 4) world_T_camera of a path, P >= frames.
        size: Keyframes are chosen from the poses.
        seed: Of the random numbers.

    Raises:
        ValueError: The path does not have as many views of landmarks.
    """
    rng = np.random.default_rng(seed)
    poses = choose_keyframes(poses, size.frames)
    first, points = _place_landmarks(poses, _CANDIDATES * size.landmarks, rng)
    parts = [vars(part).values() for part in _views(poses, first, points)]
    views = _Views(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    views = views.rows(np.isin(views.landmark, _seen_twice(views, size.landmarks, rng)))
    seen = views.rows(_found(views, size.observations, rng))
    kept, landmark = np.unique(seen.landmark, return_inverse=True)
    origin, points = poses[first[kept], :3, 3], points[kept]
    at = np.arange(0, size.frames, _FIX_EVERY)
    sigma_m = np.full((len(at), 3), _FIX_SIGMA_M)
    priors = Priors(at, poses[at, :3, 3] + rng.normal(0.0, sigma_m), sigma_m)
    start = np.array([gtsam.Pose3(T).retract(rng.normal(0.0, _START_SIGMA)).matrix() for T in poses])
    problem = BundleProblem(
        K=(CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy),
        world_T_camera=start,
        world_p_landmark=origin + (points - origin) * rng.normal(1.0, _START_DEPTH_SIGMA, (len(points), 1)),
        frame=seen.frame,
        landmark=landmark,
        uv_px=seen.uv_px + rng.normal(0.0, _PIXEL_SIGMA_PX, seen.uv_px.shape),
        sigma_px=np.full(len(seen.frame), _PIXEL_SIGMA_PX),
        pose_graph=priors.graph(),
    )
    return problem, priors


def choose_keyframes(poses: FloatArray, count: int) -> FloatArray:
    """Return so many of the poses, evenly by distance and turn."""
    steps = np.linalg.inv(poses[:-1]) @ poses[1:]
    turn = np.arccos(np.clip((np.trace(steps[:, :3, :3], axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    path_m = np.append(0.0, np.cumsum(np.linalg.norm(steps[:, :3, 3], axis=1) + _TURN_AS_M * turn))
    number = np.arange(count)
    chosen = np.searchsorted(path_m, np.linspace(0.0, path_m[-1], count))
    chosen = np.maximum.accumulate(chosen - number) + number  # none twice
    return poses[np.minimum(chosen, len(poses) - count + number)]


def _place_landmarks(poses: FloatArray, count: int, rng: np.random.Generator) -> tuple[IntArray, FloatArray]:
    """Return first frame (L,) and points (L, 3): even in images of a road between walls, and behind gaps."""
    first = np.sort(rng.integers(0, len(poses) - 2, count))
    x = (rng.uniform(0.0, CAMERA.width, count) - CAMERA.cx) / CAMERA.fx
    y = (rng.uniform(0.0, CAMERA.height, count) - CAMERA.cy) / CAMERA.fy
    wall = rng.uniform(*_WALL_M, count) / np.maximum(np.abs(x), 1e-3)
    road = _CAMERA_HEIGHT_M / np.maximum(y, 1e-3)
    depth = np.maximum(np.minimum(wall, road), _NEAR_M)
    far = depth > _FAR_M
    depth[far] = rng.uniform(0.3 * _FAR_M, _FAR_M, int(far.sum()))
    camera_p = np.stack([x, y, np.ones(count)], axis=1) * depth[:, None]
    T = poses[first]
    return first, np.einsum("lij,lj->li", T[:, :3, :3], camera_p) + T[:, :3, 3]


@dataclass(frozen=True)
class _Views:
    """Landmarks in frames, with pixels (n, 2), in order of landmark and frame."""

    landmark: IntArray
    frame: IntArray
    uv_px: FloatArray

    def rows(self, rows: IntArray | BoolArray) -> "_Views":
        return _Views(self.landmark[rows], self.frame[rows], self.uv_px[rows])

    @property
    def begins(self) -> BoolArray:
        """(n,) whether a row is the first of its landmark."""
        return np.asarray(np.diff(self.landmark, prepend=-1) != 0)

    @property
    def visits(self) -> IntArray:
        """(n,) number of the visit, over all landmarks."""
        return np.cumsum(self.begins | (np.diff(self.frame, prepend=0) > _PAUSE)) - 1


def _views(poses: FloatArray, first: IntArray, points: FloatArray) -> Iterator[_Views]:
    """Yield the views in which landmarks look as in their first one, for the sake of memory in parts."""
    tree = KDTree(poses[:, :3, 3])
    for rows in np.array_split(np.arange(len(points)), max(len(points) // _AT_ONCE, 1)):
        near = [np.array(found, np.int64) for found in tree.query_ball_point(points[rows], _FAR_M)]
        landmark, frame = np.repeat(rows, [len(found) for found in near]), np.concatenate(near)
        later = frame >= first[landmark]
        landmark, frame = landmark[later], frame[later]
        start = first[landmark]
        uv, depth = (v[:, 0] for v in project(CAMERA.K, poses[frame], points[landmark, None]))
        size = project(CAMERA.K, poses[start], points[landmark, None])[1][:, 0] / np.maximum(depth, 1e-3)
        ray, before = (points[landmark] - poses[f, :3, 3] for f in (frame, start))
        cosine = np.einsum("ni,ni->n", ray, before) / (norm(ray, axis=1) * norm(before, axis=1))
        seen = np.all((uv >= 0.0) & (uv < (CAMERA.width, CAMERA.height)), axis=1) & (depth > 0.0)
        seen &= (size > _SIZE[0]) & (size < _SIZE[1]) & (cosine > np.cos(_MAX_ANGLE))
        seen |= frame == start
        yield _Views(landmark[seen], frame[seen], uv[seen])


def _seen_twice(views: _Views, count: int, rng: np.random.Generator) -> IntArray:
    """Return so many landmarks at random, of those with several views in their first visit."""
    several = views.landmark[np.flatnonzero(views.begins[:-1] & (np.diff(views.visits) == 0))]
    if len(several) < count:
        raise ValueError(f"{len(several)} landmarks are seen twice, expected {count}")
    return rng.choice(several, count, replace=False)


def _found(views: _Views, count: int, rng: np.random.Generator) -> IntArray:
    """Return so many rows: tracks from the beginning of a visit on, of exponentially distributed length.

    Of each landmark the first two views; the mean length of the tracks follows from the count.
    """
    visit, new = views.visits, views.begins
    begin = np.searchsorted(visit, np.arange(visit[-1] + 1))
    found = new[begin] | (rng.uniform(size=len(begin)) < _FOUND_AGAIN)
    age = np.arange(len(visit)) - begin[visit]
    age = np.maximum(age - new[begin][visit], 0) / rng.exponential(size=len(begin))[visit]
    age[~found[visit]] = np.inf
    if np.isfinite(age).sum() < count:
        raise ValueError(f"{np.isfinite(age).sum()} views are found, expected {count}")
    return np.sort(np.argsort(age, kind="stable")[:count])
