"""The textured room, visited twice: the path of the second visit is off, the images say by how much."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from textured_room import CAMERA, CONFIG, image, moved, path, pixels, points_at

from vgps.config import LoopsConfig
from vgps.model import Frame
from vgps.places.loops import Loop, _confirmed, find_loops
from vgps.places.revisits import PosedVideo
from vgps.solution import Observations
from vgps.tracking.corners import new_corners

VISIT, AWAY = 5, 10
SETTINGS = LoopsConfig(spacing=0.01, apart=1.0)


def two_visits() -> np.ndarray:
    """True poses: a visit, some frames far off that look elsewhere, and the visit again, 20 cm beside."""
    first = path(VISIT)
    away = np.stack([moved(first[-1], 3.0 * (k + 1) * (-1) ** k, (0, 120, 0)) for k in range(AWAY)])
    return np.concatenate([first, away, [moved(pose, 0.2, (0, 2, 0)) for pose in first]])


def video_of(poses: np.ndarray, off_m: float, sigma_m: float) -> PosedVideo:
    """What stage D would say: the second visit lies aside by ``off_m``, with landmarks of its own."""
    frames, landmarks, uv, points = [], [], [], []
    wrong = poses.copy()
    wrong[VISIT + AWAY :, 0, 3] += off_m
    for group in (range(VISIT), range(VISIT, VISIT + AWAY), range(VISIT + AWAY, len(poses))):
        rng = np.random.default_rng(1)
        corners = new_corners(image(poses[group[0]]), np.zeros((0, 2)), 150, CONFIG.tracking, rng)
        seen = points_at(poses[group[0]], corners)
        for frame in group:
            at = pixels(poses[frame], seen)
            kept = np.flatnonzero(np.all((at > 12) & (at < (CAMERA.width - 12, CAMERA.height - 12)), axis=1))
            frames.append(np.full(len(kept), frame))
            landmarks.append(kept + sum(map(len, points)))
            uv.append(at[kept])
        points.append(seen + (wrong[group[0], :3, 3] - poses[group[0], :3, 3]))
    observations = Observations(np.concatenate(frames), np.concatenate(landmarks), np.concatenate(uv))
    sigmas = np.full(len(poses), sigma_m)
    return PosedVideo(
        poses=wrong, sigma_m=sigmas, points=np.concatenate(points), observations=observations, camera=CAMERA
    )


def shown(poses: np.ndarray) -> Iterator[Frame]:
    for index, pose in enumerate(poses):
        yield Frame(index, index / 10, image(pose))


@pytest.mark.slow
def test_landmarks_of_the_first_visit_are_found_in_the_second() -> None:
    poses = two_visits()
    video = video_of(poses, off_m=0.6, sigma_m=0.3)
    loops = find_loops(video, shown(poses), SETTINGS)
    assert [loop.frame for loop in loops] == list(range(VISIT + AWAY, len(poses)))
    for loop in loops:
        assert loop.earlier < VISIT
        assert np.linalg.norm(loop.world_T_camera[:3, 3] - poses[loop.frame, :3, 3]) < 0.02
        # the landmarks are where the true pose sees them, not where the path says
        error = loop.raw_uv_px - pixels(poses[loop.frame], video.points[loop.landmark])
        assert len(loop.landmark) > 50 and np.median(np.linalg.norm(error, axis=1)) < 0.2


@pytest.mark.slow
def test_nothing_is_found_where_a_later_frame_is_masked() -> None:
    poses, right = two_visits(), np.ones((CAMERA.height, CAMERA.width), bool)
    right[:, : CAMERA.width // 2] = False

    def masked(mask: np.ndarray) -> Iterator[Frame]:
        return (replace(frame, mask=mask) for frame in shown(poses))

    video = video_of(poses, off_m=0.6, sigma_m=0.3)
    loops = find_loops(video, masked(right), SETTINGS)
    assert len(loops) == VISIT
    for loop in loops:
        assert len(loop.landmark) > 20 and loop.raw_uv_px[:, 0].min() > CAMERA.width // 2 - 1
    assert find_loops(video, masked(np.zeros_like(right)), SETTINGS) == ()


@pytest.mark.slow
def test_a_place_beyond_the_sigmas_of_the_path_is_a_look_alike() -> None:
    poses = two_visits()
    assert find_loops(video_of(poses, off_m=4.0, sigma_m=0.1), shown(poses), SETTINGS) == ()
    assert len(find_loops(video_of(poses, off_m=4.0, sigma_m=1.0), shown(poses), SETTINGS)) == VISIT


@pytest.mark.slow
def test_a_single_frame_confirms_nothing() -> None:
    poses = two_visits()
    frames = [frame for frame in shown(poses) if frame.index <= VISIT + AWAY]
    assert find_loops(video_of(poses, 0.6, 0.3), frames, SETTINGS) == ()


def test_neighbours_that_are_off_differently_confirm_nothing() -> None:
    poses = two_visits()
    video = video_of(poses, off_m=0.0, sigma_m=0.3)

    def agreeing(off_m: list[float]) -> list[bool]:
        loops = []
        for frame, off in zip(range(VISIT + AWAY, len(poses)), off_m, strict=True):
            pose = moved(video.poses[frame], off)
            nothing = (np.zeros(0, np.int64), np.zeros((0, 2)))
            loops.append(
                Loop(frame=frame, earlier=0, world_T_camera=pose, landmark=nothing[0], raw_uv_px=nothing[1])
            )
        return _confirmed(loops, video, SETTINGS).tolist()

    assert agreeing([0.5, 0.5, 0.5, 0.5, 0.5]) == [True] * 5
    assert agreeing([0.5, 0.5, 0.5, 9.0, -9.0]) == [True] * 3 + [False] * 2


def test_nothing_is_decoded_where_the_path_does_not_come_back() -> None:
    def frames() -> Iterator[Frame]:
        raise AssertionError("decoded")
        yield

    video = video_of(two_visits(), 0.0, 0.1)
    assert find_loops(video, frames(), LoopsConfig(apart=1000.0)) == ()
