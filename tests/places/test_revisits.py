from dataclasses import replace

import numpy as np
import pytest

from vgps.config import LoopsConfig
from vgps.model import Camera, FloatArray
from vgps.places.revisits import PosedVideo, allowed, revisits, spaced_frames
from vgps.solution import Observations

CAMERA = Camera(model="pinhole", width=320, height=240, fx=260.0, fy=260.0, cx=160.0, cy=120.0)
DEPTH = 10.0


def looking_along(centre: FloatArray, sigma_m: float = 0.1) -> PosedVideo:
    """A camera on a path (F, 3) that looks where it goes, one landmark in each frame, ten metres ahead."""
    ahead = np.gradient(centre, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    poses = np.tile(np.eye(4), (len(centre), 1, 1))
    poses[:, :3, 2], poses[:, :3, 1] = ahead, [0.0, 0.0, -1.0]
    poses[:, :3, 0] = np.cross(poses[:, :3, 1], ahead)
    poses[:, :3, 3] = centre
    rows = np.arange(len(centre))
    return PosedVideo(
        poses=poses,
        sigma_m=np.full(len(centre), sigma_m),
        points=centre + DEPTH * ahead,
        observations=Observations(rows, rows, np.full((len(rows), 2), 100.0)),
        camera=CAMERA,
    )


def circle(laps: float, radius_m: float = 30.0) -> FloatArray:
    angle = np.arange(0.0, laps * 2 * np.pi, 0.5 / radius_m)
    return radius_m * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)


def test_a_second_lap_meets_the_first_and_one_lap_nothing() -> None:
    config = LoopsConfig()
    lap = 2 * np.pi * 30.0
    pairs = revisits(looking_along(circle(1.25)), config)
    travelled = 0.5 * (pairs[:, 0] - pairs[:, 1])
    assert len(pairs) > 20 and np.abs(travelled - lap).max() < config.reach * DEPTH + 1.0
    nearest = pairs[np.unique(pairs[:, 0], return_index=True)[1]]
    assert np.median(np.abs(0.5 * (nearest[:, 0] - nearest[:, 1]) - lap)) < 1.0
    assert len(revisits(looking_along(circle(0.9)), config)) == 0


def test_the_way_back_looks_another_way() -> None:
    there = np.stack([0.5 * np.arange(200), np.zeros(200), np.zeros(200)], axis=-1)
    to_and_fro = np.concatenate([there, there[::-1] + np.array([0, 1, 0])])
    assert len(revisits(looking_along(to_and_fro), LoopsConfig())) == 0


@pytest.mark.parametrize(("sigma_m", "meets"), [(0.5, False), (5.0, True)])
def test_what_sigmas_allow_is_a_revisit(sigma_m: float, meets: bool) -> None:
    centre = circle(1.2)
    centre *= np.clip(np.linspace(0.8, 1.8, len(centre)), 1.0, 1.5)[:, None]  # a spiral, at last 15 m off
    assert (len(revisits(looking_along(centre, sigma_m), LoopsConfig())) > 0) == meets


def test_each_pair_has_the_sigmas_of_its_own_frames() -> None:
    centre = circle(1.2) * np.linspace(1.0, 1.5, len(circle(1.2)))[:, None]  # a spiral, at least 12 m off
    video = looking_along(centre)
    video.sigma_m[400:500] = 50.0  # elsewhere on the path
    pairs = revisits(video, LoopsConfig())
    assert len(pairs) > 0 and np.all(((pairs >= 400) & (pairs < 500)).any(axis=1))


def test_of_several_runs_only_frames_of_different_ones_are_compared() -> None:
    there = np.stack([0.5 * np.arange(200), np.zeros(200), np.zeros(200)], axis=-1)
    video = looking_along(np.concatenate([there, there + np.array([0, 1, 0])]))
    video.poses[:, :3, :3] = video.poses[:1, :3, :3]  # the step from one run to the other is none
    pairs = revisits(replace(video, run=np.repeat([0, 1], 200)), LoopsConfig())
    assert len(pairs) > 50 and np.all((pairs[:, 0] >= 200) & (pairs[:, 1] < 200))


def test_frames_are_spaced_by_the_depth_and_a_standing_camera_gives_one() -> None:
    centre = np.stack([0.5 * np.arange(100), np.zeros(100), np.zeros(100)], axis=-1)
    video = looking_along(centre)
    assert spaced_frames(video, 0.15).tolist() == list(range(0, 100, 3))
    still = replace(video, poses=np.tile(video.poses[:1], (100, 1, 1)))
    assert spaced_frames(still, 0.15).tolist() == [0]


def test_frames_without_landmarks_or_sigma_are_left_out() -> None:
    video = looking_along(circle(1.25))
    assert len(revisits(replace(video, sigma_m=np.full(len(video.poses), np.nan)), LoopsConfig())) == 0
    nothing = Observations(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))
    assert len(revisits(replace(video, observations=nothing), LoopsConfig())) == 0


@pytest.mark.parametrize(
    ("off_m", "turned_deg", "expected"), [(2.9, 44, True), (3.1, 0, False), (0.0, 46, False)]
)
def test_a_pose_may_differ_from_that_by_the_path_by_its_sigmas_and_a_share_of_the_depth(
    off_m: float, turned_deg: float, expected: bool
) -> None:
    turn, pose = np.radians(turned_deg), np.eye(4)
    pose[:3, 2], pose[0, 3] = [np.sin(turn), 0.0, np.cos(turn)], off_m
    assert allowed(pose, np.eye(4), sigma_m=0.5, depth_m=DEPTH, config=LoopsConfig()) is expected
