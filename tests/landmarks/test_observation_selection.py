from dataclasses import replace

import numpy as np
from synthetic_run import FRAMES, WallRun

from vgps.config import LandmarksConfig
from vgps.geometry import project
from vgps.landmarks.observation_selection import (
    collect_observations,
    reliable_landmarks,
    select_views,
    template_frames,
)
from vgps.rolling_shutter import row_poses
from vgps.solution import FrameState

CONFIG = LandmarksConfig()


def test_observations_are_sorted_and_compared_with_projections(wall: WallRun) -> None:
    shifted = replace(
        wall.solution.observations, uv_px=wall.solution.observations.uv_px + np.array([0.3, -0.4])
    )
    found = collect_observations(replace(wall.solution, observations=shifted))
    assert len(found.landmark) == len(shifted.landmark)
    assert (np.diff(found.landmark) >= 0).all()
    np.testing.assert_allclose(found.error_px, 0.5, atol=1e-9)


def test_a_rolling_shutter_sees_landmarks_from_the_poses_of_its_rows(wall: WallRun) -> None:
    camera = replace(wall.solution.camera, readout_s=0.03)
    seen = wall.solution.observations
    uv = seen.uv_px
    for _ in range(4):
        poses = row_poses(camera, wall.solution.t_s, wall.solution.world_T_camera, seen.frame, uv)
        points = wall.solution.landmarks.world_p_landmark[seen.landmark]
        uv = project(camera.K, poses, points[:, None])[0][:, 0]
    rolling = replace(wall.solution, camera=camera, observations=replace(seen, uv_px=uv))
    found = collect_observations(rolling)
    assert np.linalg.norm(uv - seen.uv_px, axis=1).max() > 1.0
    np.testing.assert_allclose(found.error_px, 0.0, atol=0.01)


def test_only_tracked_frames_of_the_selected_parity_give_templates(wall: WallRun) -> None:
    state = tuple(FrameState.BRIDGED if i < 12 else FrameState.TRACKED for i in range(FRAMES))
    solution = replace(wall.solution, state=state)
    assert np.flatnonzero(template_frames(solution, "all")).tolist() == list(range(12, FRAMES))
    assert np.flatnonzero(template_frames(solution, "even")).tolist() == list(range(12, FRAMES, 2))
    assert np.flatnonzero(template_frames(solution, "odd")).tolist() == list(range(13, FRAMES, 2))


def reliable(wall: WallRun, **changes) -> np.ndarray:
    observations = collect_observations(wall.solution)
    return reliable_landmarks(wall.solution, observations, LandmarksConfig(**changes))[0]


def test_each_limit_on_landmarks(wall: WallRun) -> None:
    sigma_px = wall.solution.landmarks.sigma_px
    everything = reliable(wall, max_relative_sigma=1e9)
    count = np.bincount(wall.solution.observations.landmark, minlength=len(sigma_px))
    np.testing.assert_array_equal(everything, count >= 4)
    often = reliable(wall, max_relative_sigma=1e9, min_observations=20)
    np.testing.assert_array_equal(often, count >= 20)
    precise = reliable(wall, max_relative_sigma=1e9, max_sigma_px=0.45)
    np.testing.assert_array_equal(precise, everything & (sigma_px <= 0.45))
    certain = reliable(wall, max_relative_sigma=0.03)
    assert 0 < certain.sum() < everything.sum()


def test_the_position_sigma_does_not_shrink_with_the_number_of_observations(wall: WallRun) -> None:
    observations = collect_observations(wall.solution)
    _, sigma_m = reliable_landmarks(wall.solution, observations, CONFIG)
    twice = observations.take(np.repeat(np.arange(len(observations.landmark)), 2))
    _, sigma_twice_m = reliable_landmarks(wall.solution, twice, CONFIG)
    np.testing.assert_allclose(sigma_twice_m, sigma_m)


def test_views_are_those_of_small_error_inside_the_image(wall: WallRun) -> None:
    observations = collect_observations(wall.solution)
    false = observations.frame < 6
    observations = replace(observations, error_px=np.where(false, 3.1, 0.1))
    views = select_views(wall.solution, observations, "all", LandmarksConfig(patch_px=31))
    assert views.frame.min() == 6
    assert ((views.uv_px >= 15) & (views.uv_px <= (304, 224))).all()
    assert np.unique(views.landmark, return_counts=True)[1].max() == 8
