"""The benchmark of places seen again: how ties are judged, and the way back."""

import numpy as np
from solutions import make_solution
from textured_room import CAMERA, path, pixels, points_at, room_gps_log, room_recording

from scripts.benchmarks.loops import misfits_px
from scripts.common.there_and_back import one_pass, there_and_back, truth_there_and_back
from vgps.model import FixClass
from vgps.solution import Landmarks, Observations, Trajectory


def test_a_tie_is_judged_by_the_true_poses() -> None:
    poses = path(6)
    points = points_at(poses[0], np.array([[60.0, 60.0], [160.0, 120.0], [260.0, 200.0]]))
    frame, landmark = np.repeat([0, 5], 3), np.tile(np.arange(3), 2)
    uv = np.concatenate([pixels(poses[0], points), pixels(poses[5], points) + np.array([3.0, 4.0])])
    moved = np.eye(4)
    moved[:3, 3] = [7.0, -2.0, 1.0]  # the world of the solution is off: only relative poses count
    tied = make_solution(
        np.arange(6) / 10,
        moved @ poses,
        camera=CAMERA,
        landmarks=Landmarks(points + moved[:3, 3], np.ones(3), np.zeros(3, np.uint8)),
        observations=Observations(frame, landmark, uv),
        loops=np.array([[5, 0]]),
    )
    np.testing.assert_allclose(misfits_px(tied, Trajectory(np.arange(6) / 10, poses)), [5.0], atol=1e-6)


def test_the_way_back_mirrors_frames_fixes_and_truth() -> None:
    poses = path(5)
    recording = room_recording(poses, gps=room_gps_log(poses))
    made = there_and_back(recording, recording, 4)
    np.testing.assert_allclose(made.video.times_s, np.arange(8) / 10)
    frames = list(made.video.frames())
    assert [frame.index for frame in frames] == list(range(8))
    for k in range(4):
        np.testing.assert_array_equal(frames[k].gray, frames[7 - k].gray)
    log = made.gps
    assert log is not None and log.fix_class == (FixClass.RTK_FIX,) * 2
    np.testing.assert_allclose(log.t_s, [0.0, 0.7])  # the fix at 0.3 s is not before the last frame
    assert log.latitude_deg[0] == log.latitude_deg[1]
    truth = truth_there_and_back(Trajectory(np.arange(5) / 10, poses), made)
    np.testing.assert_array_equal(truth.world_T_camera[7], poses[0])
    assert len(one_pass(recording, 3).video.times_s) == len(list(one_pass(recording, 3).video.frames())) == 3
