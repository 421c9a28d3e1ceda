"""Residuals and statistics of marks, by hand and against OpenCV."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from solutions import EAST_R_CAMERA, PINHOLE, make_poses, make_solution

from vgps.camera import distort, project, undistort
from vgps.evaluation.check_points import mark_statistics, marks_of, summary_line
from vgps.geodesy import to_geodetic
from vgps.model import Camera, ControlPoints
from vgps.rolling_shutter import row_poses

LENS = replace(PINHOLE, model="opencv", distortion=(-0.1, 0.02, 1e-3, -5e-4))


def run_with_marks(places, error_m=(0.0, 0.0, 0.0), camera: Camera = LENS, noise_px=0.0, geodetic=False):
    """A walk to the east past marks, whose surveyed positions are off by an error; half are check points."""
    path = np.arange(12.0)[:, None] * [0.5, 0, 0]
    poses = make_poses(path, EAST_R_CAMERA)
    rng = np.random.default_rng(0)
    frame, mark, uv = [], [], []
    for k, place in enumerate(places):
        for f in (0, 5, 11):
            seen = project(camera, ((place - poses[f, :3, 3]) @ poses[f, :3, :3])[None])[0]
            frame.append(f), mark.append(k), uv.append(seen + noise_px * rng.normal(size=2))
    surveyed = np.array(places)[mark] - error_m
    solution = make_solution(np.arange(12.0), poses, camera=camera)
    points = ControlPoints(
        name=tuple(f"M{k}" for k in mark),
        frame=np.array(frame),
        uv_px=np.array(uv),
        world_p_point=to_geodetic(solution.world_origin, surveyed) if geodetic else surveyed,
        sigma_m=np.zeros((len(mark), 3)),
        check=np.array(mark) % 2 == 1,
        geodetic=geodetic,
        source=Path("control_points.csv"),
    )
    return replace(solution, control_points=points)


PLACES = np.random.default_rng(1).uniform([12, 3.2, -2], [15, 4.5, 2], (10, 3))  # seen at 5 degrees and more


@pytest.mark.parametrize("geodetic", [False, True])
def test_residuals_are_what_the_survey_is_off(geodetic):
    marks = marks_of(run_with_marks(PLACES, (0.03, -0.04, 0.1), geodetic=geodetic))
    assert [mark.name for mark in marks] == [f"M{k}" for k in range(10)]
    assert [mark.check for mark in marks] == [False, True] * 5
    for mark in marks:
        np.testing.assert_allclose(mark.residual_m, [0.03, -0.04, 0.1], atol=1e-5)
    found = mark_statistics(marks)
    np.testing.assert_allclose(found.rmse_m, [0.03, 0.04, 0.1], atol=1e-5)
    assert (found.rmse_horizontal_m, found.ce90_m, found.le90_m) == pytest.approx((0.05, 0.05, 0.1), abs=1e-5)
    assert found.rmse_3d_m == pytest.approx(np.hypot(0.05, 0.1), abs=1e-5)


def test_exact_marks_reproject_exactly_through_the_lens():
    assert np.abs(distort(LENS, np.array([[600.0, 30.0]])) - [600.0, 30.0]).max() > 1  # it is not a pinhole
    for mark in marks_of(run_with_marks(PLACES)):
        np.testing.assert_allclose(mark.reprojected_px, mark.uv_px, atol=1e-3)
        assert mark.rms_px < 1e-3


def test_marks_in_the_rows_of_a_rolling_shutter_reproject_exactly():
    run = run_with_marks(PLACES)
    camera, points = replace(LENS, readout_s=0.5), run.control_points
    uv = points.uv_px
    for _ in range(8):  # the row in which a mark is seen decides from where
        poses = row_poses(camera, run.t_s, run.world_T_camera, points.frame, undistort(camera, uv))
        away = points.world_p_point - poses[:, :3, 3]
        uv = project(camera, np.einsum("nji,nj->ni", poses[:, :3, :3], away))
    assert np.abs(uv - points.uv_px).max() > 1.0
    rolling = replace(run, camera=camera, control_points=replace(points, uv_px=uv))
    for mark in marks_of(rolling):
        assert mark.rms_px < 1e-3
        np.testing.assert_allclose(mark.residual_m, 0.0, atol=1e-4)


def test_intersections_are_those_of_opencv():
    run = run_with_marks(PLACES, camera=PINHOLE, noise_px=0.5)
    points = run.control_points
    for k, mark in enumerate(marks_of(run)):
        rows = [3 * k, 3 * k + 2]  # OpenCV takes two views
        two = replace(
            points,
            name=tuple(points.name[row] for row in rows),
            frame=points.frame[rows],
            uv_px=points.uv_px[rows],
            world_p_point=points.world_p_point[rows],
            sigma_m=points.sigma_m[rows],
            check=points.check[rows],
        )
        (alone,) = marks_of(replace(run, control_points=two))
        P = [PINHOLE.K @ np.linalg.inv(run.world_T_camera[f])[:3] for f in two.frame]
        better = cv2.correctMatches(fundamental(*P), two.uv_px[None, :1], two.uv_px[None, 1:])
        point = cv2.triangulatePoints(*P, better[0][0].T, better[1][0].T)[:, 0]
        np.testing.assert_allclose(alone.residual_m + mark.world_p_mark, point[:3] / point[3], atol=1e-3)


def fundamental(P1, P2):
    """F of two cameras, x2^T F x1 = 0."""
    centre = np.linalg.svd(P1)[2][-1]
    e = P2 @ centre
    cross = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    return cross @ P2 @ np.linalg.pinv(P1)


@pytest.mark.slow
def test_ce90_and_le90_hold_nine_tenths_of_the_marks():
    marks = marks_of(run_with_marks(np.random.default_rng(2).uniform([12, 3.2, -2], [15, 4.5, 2], (200, 3))))
    rng = np.random.default_rng(3)
    error = rng.normal(0, [0.1, 0.1, 0.2], (200, 3))
    marks = [replace(mark, residual_m=one) for mark, one in zip(marks, error, strict=True)]
    found = mark_statistics(marks)
    assert np.mean(np.hypot(*error[:, :2].T) <= found.ce90_m) == pytest.approx(0.9, abs=0.005)
    assert np.mean(np.abs(error[:, 2]) <= found.le90_m) == pytest.approx(0.9, abs=0.005)
    assert found.ce90_m == pytest.approx(2.146 * 0.1, rel=0.1)  # of a circular normal distribution
    assert found.le90_m == pytest.approx(1.645 * 0.2, rel=0.1)


def test_a_mark_in_one_frame_has_pixels_and_no_position():
    run = run_with_marks(PLACES[:2])
    points = run.control_points
    alone = replace(points, name=("A", "B", "C", "D", "E", "F"))
    marks = marks_of(replace(run, control_points=alone))
    assert all(np.isnan(mark.residual_m).all() and mark.rms_px < 1e-3 for mark in marks)
    assert mark_statistics(marks) is None
    assert summary_line(replace(run, control_points=alone)) is None


def test_a_mark_behind_the_camera_is_not_reprojected():
    run = run_with_marks([np.array([-5.0, 0.3, 0.2]), PLACES[0]])
    (behind, _) = marks_of(
        replace(run, control_points=replace(run.control_points, uv_px=np.full((6, 2), 300.0)))
    )
    assert np.isnan(behind.reprojected_px).all() and np.isnan(behind.residual_m).all()


def test_the_summary_is_a_sentence():
    line = summary_line(run_with_marks(PLACES, (0.03, -0.04, 0.1)))
    assert line == (
        "5 of 5 check points: RMSE horizontal 0.050 m, vertical 0.100 m, CE90 0.050 m, LE90 0.100 m"
    )
