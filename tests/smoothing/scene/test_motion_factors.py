"""Which frames move at constant velocity: those that nothing else holds, and those beside a longer gap."""

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from solutions import make_poses

from vgps.config import MotionConfig
from vgps.smoothing.scene.few_frames import thinned
from vgps.smoothing.scene.motion_factors import motion_factors
from vgps.smoothing.scene.scene import MIN_LANDMARKS, Scene
from vgps.solution import Observations

INTERVAL_S = 0.05


def graph_of(unseen, frames=60, seam=(), carried=None):
    """Three landmarks are seen from all frames but the unseen ones, and other ones from a seam on."""
    rows = np.isin(np.arange(frames), unseen)
    frame = np.repeat(np.flatnonzero(~rows), 3)
    landmark = np.tile(np.arange(3), np.count_nonzero(~rows)) + 3 * np.searchsorted(seam, frame, side="right")
    observations = Observations(frame, landmark, np.zeros((len(frame), 2)))
    poses = np.tile(np.eye(4), (frames, 1, 1))
    scene = Scene(INTERVAL_S * np.arange(frames), poses, np.zeros((9, 3)), observations)
    return motion_factors(scene, rows, scene.torn(MIN_LANDMARKS), MotionConfig(), carried=carried)


def middles(unseen, seam=(), carried=None):
    graph = graph_of(unseen, seam=seam, carried=carried)
    return [gtsam.Symbol(graph.at(row).keys()[1]).index() for row in range(graph.size())]


@pytest.mark.parametrize(
    ("unseen", "expected"),
    [
        ([], []),
        ([7], [7]),
        ([7, 9], [7, 9]),
        (range(7, 11), range(7, 11)),  # 0.25 s from 6 to 11
        (range(7, 13), range(6, 14)),  # 0.35 s from 6 to 13
        ([0, 1], [1, 2]),  # nothing but the velocity after it poses the beginning
        ([59], [58]),
    ],
)
def test_frames_in_the_middle_of_triples(unseen, expected):
    assert middles(unseen) == list(expected)


@pytest.mark.parametrize(
    ("unseen", "seam", "expected"),
    [
        ([], [25], [24, 25]),  # the velocities of both sides and between them
        ([25], [25], [24, 25, 26]),
        ([25], [27], [25, 26, 27]),
        ([], [25, 33], range(24, 34)),  # 0.35 s of a map say little of its scale
        ([], [7], range(1, 8)),
        ([], [1], [1]),
        ([], [59], [58]),
    ],
)
def test_the_frames_beside_the_seam_of_two_maps_tie_them(unseen, seam, expected):
    """Beside velocity nothing does."""
    assert middles(unseen, seam=seam) == list(expected)


def test_an_imu_ties_what_it_carries():
    carried = np.isin(np.arange(60), [25, 26, 30])
    assert middles([30], seam=[25, 28], carried=carried) == [24, 27, 28, 30]


def test_a_scene_of_few_frames_is_torn_where_that_of_all_is():
    """At corners hardly a track lasts from one in four frames to the next."""
    frame = np.repeat(np.arange(12), 2)
    landmark = np.repeat(np.arange(12), 2) + np.tile([0, 1], 12)  # each in two frames
    landmark[frame > 6] += 1  # none leads from frame 6 to 7
    observations = Observations(frame, landmark, np.zeros((24, 2)))
    scene = Scene(0.1 * np.arange(12), np.tile(np.eye(4), (12, 1, 1)), np.zeros((14, 3)), observations)
    assert scene.crossing_tracks().tolist() == [1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 1]
    few = thinned(scene, 4)
    assert few.t_s.tolist() == [0.0, 0.4, 0.8] and few.crossing_tracks().tolist() == [1, 0]
    assert few.torn(1).tolist() == [False, True] and few.with_observations(np.zeros(6, bool)).torn(1)[1]


def test_a_short_gap_leaves_its_neighbours_where_they_are_however_uneven_their_steps():
    """Pictures up to a frame late: the step over the gap is as long as the next, in twice the time."""
    seen = [0, 2, 3]
    poses = make_poses(np.column_stack([[0.0, 0.3, 1.0, 2.0], np.zeros(4), np.zeros(4)]), np.eye(3))
    graph, values = graph_of([1], frames=4), gtsam.Values()
    for frame, pose in enumerate(poses):
        values.insert(X(frame), gtsam.Pose3(pose))
        if frame in seen:
            graph.push_back(
                gtsam.PriorFactorPose3(X(frame), gtsam.Pose3(pose), gtsam.noiseModel.Isotropic.Sigma(6, 1.0))
            )
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    x = [found.atPose3(X(frame)).x() for frame in range(4)]
    np.testing.assert_allclose(x, [0.0, 0.5, 1.0, 2.0], atol=1e-6)
