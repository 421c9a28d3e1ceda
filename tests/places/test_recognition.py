"""The textured room, visited twice: the path of the second visit is off, the images say by how much."""

import numpy as np
import pytest
from textured_room import CAMERA, CONFIG, image, moved, path, pixels, points_at

from vgps.config import LoopsConfig
from vgps.geometry import project
from vgps.model import Frame
from vgps.places.place_memory import PlaceMemory, Sight, WorldPath
from vgps.places.recognition import Look, PlaceRecogniser, SeenLandmarks, refined
from vgps.tracking.corners import new_corners
from vgps.tracking.pose import Correspondences

SETTINGS = LoopsConfig(apart=1.0)
METRES = 2.0  # of a unit of the map
DEPTH_M, APART_M = 8.0, 50.0
VISIT = path(4)
AGAIN = np.stack([moved(pose, 0.2, (0, 2, 0)) for pose in VISIT])
TRUE = np.concatenate([VISIT, AGAIN])


def world_path(poses, sigma_m, sigma_rad=1e-3):
    covariance = np.diag([*[0.02**2] * 3, 1e-6, *[sigma_rad**2] * 3])
    covariances = np.tile(covariance, (len(poses), 1, 1))
    covariances[len(VISIT) :, range(3), range(3)] = sigma_m**2
    return WorldPath(first_frame=0, poses=poses, scale=np.full(len(poses), METRES), covariance=covariances)


def landmarks(frame):
    uv = new_corners(image(TRUE[frame]), np.zeros((0, 2)), 200, CONFIG.tracking, np.random.default_rng(1))
    _, depth = project(CAMERA.K, TRUE[frame], points_at(TRUE[frame], uv))
    return SeenLandmarks(frame=frame, uv_px=uv, depth=depth / METRES)


def answers(off_m, sigma_m, sigma_rad=1e-3):
    """Answers to the looks of both visits, the second of which is off by so much to the east."""
    wrong, recogniser = TRUE.copy(), PlaceRecogniser(CAMERA, SETTINGS, 10)
    wrong[len(VISIT) :, 0, 3] += off_m
    for frame, pose in enumerate(TRUE):
        again = frame >= len(VISIT)
        settled = tuple(landmarks(one) for one in range(len(VISIT))) if frame == len(VISIT) else ()
        look = Look(
            image=Frame(frame, 0.1 * frame, image(pose)),
            travelled_m=0.12 * frame + APART_M * again,
            depth_m=DEPTH_M,
            settled=settled,
        )
        yield recogniser.look(look, lambda frame=frame: world_path(wrong[: frame + 1], sigma_m, sigma_rad))


@pytest.mark.slow
def test_a_frame_is_posed_by_the_landmarks_of_an_earlier_visit_once_its_neighbours_agree():
    found = list(answers(off_m=0.6, sigma_m=1.0))
    assert [one.recognised is not None for one in found] == [False] * 6 + [True] * 2
    for answer in found[-2:]:
        one = answer.recognised
        assert one.frame - len(VISIT) - 1 <= one.earlier < len(VISIT) and one.before_m == pytest.approx(1.0)
        away_m = one.world_T_camera[:3, 3] - TRUE[one.frame, :3, 3]
        assert np.linalg.norm(away_m) < 0.03
        assert np.all(np.abs(away_m) < 4.0 * one.sigma[:3]) and 0.02 < one.sigma[:3].max() < 0.06


@pytest.mark.slow
def test_sigmas_of_a_place_hold_those_of_the_earlier_frame_and_of_the_way_from_it():
    one = list(answers(off_m=0.6, sigma_m=1.0, sigma_rad=0.3))[-1].recognised
    away_m = np.linalg.norm(TRUE[one.frame, :3, 3] - TRUE[one.earlier, :3, 3])
    assert np.all(one.sigma[3:] > 0.3) and np.all(one.sigma[:3] > 0.3 * away_m - 0.01) and away_m > 0.1


@pytest.mark.slow
def test_a_place_further_off_than_the_sigmas_allow_is_a_look_alike():
    off_m = SETTINGS.path_sigmas * 0.2 + SETTINGS.slack * DEPTH_M
    assert any(one.recognised for one in answers(0.8 * off_m, 0.2))
    assert not any(one.recognised for one in answers(1.2 * off_m, 0.2))


@pytest.mark.slow
def test_looks_are_closer_where_places_are_near():
    step_m = [one.next_m - 0.12 * k - APART_M * (k >= len(VISIT)) for k, one in enumerate(answers(0.0, 1.0))]
    np.testing.assert_allclose(step_m, DEPTH_M * np.repeat([SETTINGS.reach, SETTINGS.spacing], len(VISIT)))


def sight(frame, travelled_m):
    descriptors = np.random.default_rng(frame).integers(0, 256, (30, 32), dtype=np.uint8)
    return Sight(
        frame=frame,
        travelled_m=travelled_m,
        depth_m=DEPTH_M,
        uv_px=np.zeros((30, 2)),
        descriptors=descriptors,
    )


def test_only_places_passed_long_before_and_in_the_same_direction_are_compared():
    turned, memory = moved(VISIT[0], 0.0, (0, 90, 0)), PlaceMemory(3)
    for one in (sight(0, 0.0), sight(1, 0.0), sight(2, 100.0 - 0.9 * DEPTH_M)):
        memory.add(one, np.arange(30), np.ones((30, 3)))
    path_here = world_path(np.stack([VISIT[0], turned, VISIT[0], VISIT[0]]), 0.01)
    memory.update(path_here)
    near = memory.near(sight(3, 100.0), path_here, SETTINGS)
    assert memory.frame[near].tolist() == [0]


def test_a_place_whose_frame_was_never_on_the_path_is_nowhere():
    memory, path_here = PlaceMemory(1), world_path(np.tile(VISIT[0], (4, 1, 1)), 1.0)
    found = []
    for frame in (0, 7):
        memory.add(sight(frame, 0.0), np.arange(30), np.ones((30, 3)))
        memory.update(path_here)
        found.append(len(memory.near(sight(3, 100.0), path_here, SETTINGS)))
    assert found == [1, 0]


def test_the_oldest_place_is_forgotten():
    memory, rng = PlaceMemory(2), np.random.default_rng(0)
    sights = [sight(frame, 100.0 * frame) for frame in range(4)]
    path_here = world_path(np.tile(VISIT[0], (4, 1, 1)), 1.0)
    for one in sights[:3]:
        memory.add(one, np.arange(30), rng.normal(size=(30, 3)))
    memory.update(path_here)
    near = memory.near(sights[3], path_here, SETTINGS)
    assert sorted(memory.frame[near].tolist()) == [1, 2]
    assert memory.frame[memory.candidates(sights[2], near, 1)[0]] == 2


@pytest.mark.slow
def test_the_covariance_of_a_pose_is_that_of_its_errors():
    rng, pose = np.random.default_rng(3), VISIT[0]
    points = points_at(pose, rng.uniform(20, 220, (60, 2)))
    errors, stated = [], []
    for _ in range(200):
        seen = pixels(pose, points) + rng.normal(0.0, 0.7, (60, 2))
        found, covariance = refined(CAMERA.K, pose, Correspondences(points, seen))
        errors.append(pose[:3, :3].T @ (found[:3, 3] - pose[:3, 3]))
        stated.append(np.diagonal(covariance)[3:])
    np.testing.assert_allclose(np.std(errors, axis=0), np.sqrt(np.mean(stated, axis=0)), rtol=0.25)
