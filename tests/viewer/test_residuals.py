"""Reprojection errors and terms of the energy, by hand or by another function."""

from dataclasses import replace

import numpy as np
import pytest

from vgps.camera import project as project_distorted
from vgps.geometry import project
from vgps.rolling_shutter import row_poses
from vgps.solution import Solution
from vgps.viewer.residuals import fix_placement, gps_terms, reproject, reprojection_errors, video_terms

PLANTED = [0.6, -0.8]


def test_observations_are_sorted_by_frame_and_reprojected_into_the_distorted_image(
    solution: Solution,
) -> None:
    reprojected = reproject(solution)
    assert reprojected.frame.tolist() == sorted(solution.observations.frame.tolist())
    assert reprojected.per_frame.tolist() == [3] * 6
    np.testing.assert_array_equal(solution.observations.landmark[reprojected.order], reprojected.landmark)
    poses = solution.world_T_camera[reprojected.frame]
    point = solution.landmarks.world_p_landmark[reprojected.landmark] - poses[:, :3, 3]
    camera_p = np.einsum("nji,nj->ni", poses[:, :3, :3], point)
    expected = project_distorted(solution.camera, camera_p)
    np.testing.assert_allclose(reprojected.reprojected_px, expected, atol=1e-9)


def test_the_one_error_is_found_in_the_undistorted_image(solution: Solution) -> None:
    reprojected = reproject(solution)
    planted = (reprojected.frame == 0) & (reprojected.landmark == 0)
    np.testing.assert_allclose(reprojected.error_px[planted], [[-PLANTED[0], -PLANTED[1]]], atol=1e-9)
    np.testing.assert_allclose(reprojected.error_px[~planted], 0.0, atol=1e-9)


def test_a_rolling_shutter_is_reprojected_from_the_poses_of_its_rows(solution: Solution) -> None:
    rolling = replace(solution, camera=replace(solution.camera, readout_s=0.3))
    seen = reproject(rolling)
    uv_px = rolling.observations.uv_px[seen.order]
    poses = row_poses(rolling.camera, rolling.t_s, rolling.world_T_camera, seen.frame, uv_px)
    points = rolling.landmarks.world_p_landmark[seen.landmark]
    np.testing.assert_allclose(
        seen.error_px, project(rolling.camera.K, poses, points[:, None])[0][:, 0] - uv_px
    )
    assert np.abs(seen.error_px - reproject(solution).error_px).max() > 0.1


def test_the_term_of_a_frame_is_equation_12(solution: Solution) -> None:
    # one error of 1 px among 3 features, sigma_j = 0.5: mu = 2, Phi = 2 * 1 / 3
    np.testing.assert_allclose(video_terms(solution, reproject(solution)), [2 / 3, 0, 0, 0, 0, 0], atol=1e-9)
    rms, largest = reprojection_errors(reproject(solution))
    np.testing.assert_allclose([rms[0], largest[0], largest[1]], [np.sqrt(1 / 3), 1.0, 0.0], atol=1e-9)


def test_a_frame_without_features_has_no_term(solution: Solution) -> None:
    seen = solution.observations
    kept = seen.frame != 3
    fewer = replace(
        solution,
        observations=replace(
            seen, frame=seen.frame[kept], landmark=seen.landmark[kept], uv_px=seen.uv_px[kept]
        ),
    )
    rms, largest = reprojection_errors(reproject(fewer))
    for values in (video_terms(fewer, reproject(fewer)), rms, largest):
        assert np.isnan(values).tolist() == [False, False, False, True, False, False]


def test_the_term_of_a_used_fix_is_equation_16(solution: Solution) -> None:
    # fix 0 on the cylinder's wall: omega 1; fix 1 at (r/2, h/2): omega (1/16 + 1/16); fix 2 at h/12
    expected = [0.5, 0.5 * 2 / 16, 0.5 / 12**4, np.nan, np.nan]
    np.testing.assert_allclose(gps_terms(solution), expected, rtol=1e-9)


def test_a_fix_lies_between_frames_at_its_time_less_the_time_offset(solution: Solution) -> None:
    """Stamps of 0.03, 0.13... s with a time offset of 0.05 s, in frames 0.1 s apart."""
    shifted = replace(solution, sensors=replace(solution.sensors, time_offset_s=0.05))
    np.testing.assert_allclose(shifted.fix_times_s, [-0.02, 0.08, 0.18, 0.28, 0.38])
    found = fix_placement(shifted)
    assert found.frame.tolist() == [0, 0, 1, 2, 3] and found.inside.tolist() == [False] + [True] * 4
    np.testing.assert_allclose(found.alpha, [0.0, 0.8, 0.8, 0.8, 0.8])


@pytest.mark.parametrize("gps", [{"model": "none"}, {"model": "of a later version"}, {"unheard": 1}])
def test_an_unknown_gps_model_gives_no_terms(solution: Solution, gps: dict) -> None:
    assert np.isnan(gps_terms(replace(solution, config={"gps": gps}))).all()
