"""The calibration that landmarks of known places show: against the truth, chance, and a wall."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from vgps.camera import distort, undistort
from vgps.config import Config
from vgps.geometry import project
from vgps.localization.lens_refinement import LensCheck, refine_by_landmarks
from vgps.localization.pose import LandmarkMatches
from vgps.localization.tracker import TrackedFrame
from vgps.model import Camera
from vgps.smoothing.calibration.refined_camera import prior_about

PINHOLE = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)
BENT = replace(PINHOLE, model="opencv", distortion=(0.02, -0.01, 0.0, 0.0))
FISHEYE = replace(PINHOLE, fx=300.0, fy=300.0, model="fisheye", distortion=(0.02, -0.01, 0.0, 0.0))
CONFIG = Config()
NOISE_PX = 0.5


def frames(true, given, seed=0, count=60, depth=(4.0, 30.0), map_error_m=0.0):
    """Return tracked frames of a camera whose matches another calibration undistorted."""
    rng = np.random.default_rng(seed)
    raw = rng.uniform((20, 20), (620, 460), (400, 2))
    xy = (undistort(true, raw) - [true.cx, true.cy]) / [true.fx, true.fy]
    points = np.column_stack([xy, np.ones(400)]) * rng.uniform(*depth, (400, 1))
    placed = points + map_error_m * rng.standard_normal(points.shape)
    made = []
    for k in range(count):
        pose = gtsam.Pose3.Expmap(rng.normal(0.0, [0.02, 0.02, 0.02, 0.3, 0.3, 0.3])).matrix()
        rows = rng.choice(400, 40, replace=False)
        seen = distort(true, project(true.K, pose, points[rows])[0]) + rng.normal(0.0, NOISE_PX, (40, 2))
        inside = (seen > 0).all(axis=1) & (seen < (640, 480)).all(axis=1)
        count_seen = int(inside.sum())
        matches = LandmarkMatches(
            landmark=rows[inside],
            world_p_landmark=placed[rows[inside]],
            uv_px=undistort(given, seen[inside]),
            sigma_px=np.full(count_seen, NOISE_PX),
            shift_px=np.zeros((count_seen, 2)),
        )
        made.append(
            TrackedFrame(
                t_s=k / 10,
                world_T_camera=pose,
                covariance=np.eye(6),
                tracked=True,
                recovered=False,
                observations=matches,
                correlation=0.9,
            )
        )
    return made


def errors_in_sigmas(found, true):
    moved = [
        np.log(found.camera.fx / true.fx),
        found.camera.cx - true.cx,
        found.camera.cy - true.cy,
        *np.subtract(found.camera.distortion[:2], (true.distortion or (0.0, 0.0))[:2]),
    ]
    return np.array(moved) / np.array(list(found.sigma.values()))


@pytest.mark.parametrize(
    ("true", "given"),
    [
        (BENT, replace(PINHOLE, fx=510.0, fy=510.0)),
        (PINHOLE, replace(PINHOLE, fx=490.0, fy=490.0, cx=315.0)),
        (FISHEYE, replace(FISHEYE, fx=306.0, fy=306.0, distortion=(0.0, 0.0, 0.0, 0.0))),
    ],
)
def test_the_calibration_of_the_camera_is_found_whatever_was_given(true, given):
    prior = prior_about(given, CONFIG.intrinsics)
    found = refine_by_landmarks(prior.mean, prior, frames(true, given), CONFIG)
    assert found.converged
    assert found.sigma["focal"] < 0.001
    assert np.abs(errors_in_sigmas(found, true)).max() < 3.5


@pytest.mark.slow
def test_standard_deviations_hold_where_landmarks_err_in_all_frames_alike():
    prior = prior_about(BENT, CONFIG.intrinsics)
    made = (frames(BENT, BENT, seed, depth=(10.0, 30.0), map_error_m=0.02) for seed in range(20))
    found = [errors_in_sigmas(refine_by_landmarks(BENT, prior, one, CONFIG), BENT) for one in made]
    assert 0.6 < np.mean(np.square(found)[:, :3]) < 2.0


@pytest.mark.slow
def test_a_wall_that_is_looked_at_squarely_does_not_tell_the_focal_length():
    given = replace(PINHOLE, fx=510.0, fy=510.0)
    level = frames(PINHOLE, given, depth=(10.0, 10.0001))
    prior = prior_about(given, CONFIG.intrinsics)
    found = refine_by_landmarks(prior.mean, prior, level, CONFIG)
    sharp = refine_by_landmarks(prior.mean, prior, frames(PINHOLE, given), CONFIG)
    assert found.sigma["focal"] > 3.0 * sharp.sigma["focal"]


def check(true, given, made):
    """Return the calibrations that a check shows after each frame, and the check."""
    lens = LensCheck(given, (), CONFIG)
    return [lens.better(given, made[: k + 1]) for k in range(len(made))], lens


@pytest.mark.slow
def test_a_right_calibration_is_kept():
    shown, lens = check(PINHOLE, PINHOLE, frames(PINHOLE, PINHOLE, count=130))
    assert set(shown) == {None} and lens.notes == () and lens.found is None


@pytest.mark.slow
def test_a_wrong_one_is_told_after_sixty_frames_and_at_most_three_times():
    given = replace(PINHOLE, fx=510.0, fy=510.0)
    shown, lens = check(PINHOLE, given, frames(PINHOLE, given, count=300))
    told = [k for k, camera in enumerate(shown) if camera is not None]
    assert told == [59, 119, 179]  # after each change the next sixty count, of the same frames here
    assert shown[59].fx == pytest.approx(500.0, rel=0.003)
    assert "fx 510.0 -> 499.9 px" in lens.notes[0] and "as the landmarks show" in lens.notes[0]


def test_frames_that_were_lost_do_not_count():
    given = replace(PINHOLE, fx=510.0, fy=510.0)
    made = frames(PINHOLE, given, count=70)
    made[:20] = [replace(frame, tracked=False) for frame in made[:20]]
    shown, _ = check(PINHOLE, given, made)
    assert set(shown) == {None}
