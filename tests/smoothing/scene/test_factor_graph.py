"""Which frames the motion holds beside what they see."""

from dataclasses import replace

import gtsam
import numpy as np

from vgps.config import Config
from vgps.gps.sensors import Sensors
from vgps.mapping.zero_motion import ZeroMotion
from vgps.smoothing.scene.factor_graph import other_pose_factors
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations

SEEN = (0, 2, 3, 3, 3, 0, *[3] * 14)  # features in each frame


def scene(*standing):
    frame = np.repeat(np.arange(len(SEEN)), SEEN)
    landmark = np.concatenate([np.arange(count) for count in SEEN])
    poses = np.tile(np.eye(4), (len(SEEN), 1, 1))
    observations = Observations(frame, landmark, np.zeros((len(frame), 2)))
    return Scene(0.1 * np.arange(len(SEEN)), poses, np.zeros((3, 3)), observations, standing)


def test_two_features_determine_no_pose_and_three_do():
    """A feature that a loop adds to a lost frame left all standard deviations unknown."""
    assert np.flatnonzero(scene().unseen).tolist() == [0, 1, 5]
    still = ZeroMotion(5, 4, np.eye(4), np.ones(6))
    assert np.flatnonzero(scene(still).unseen).tolist() == [0, 1]


def middles(scene):
    few = Config(tracking={"min_inliers": 3})
    graph = other_pose_factors(scene, Sensors.fixed(np.zeros(3)), few)
    keys = [graph.at(row).keys() for row in range(graph.size())]
    return {gtsam.Symbol(triple[1]).index() for triple in keys if len(triple) == 3}


def test_constant_velocity_holds_frames_of_two_features():
    assert middles(scene()) == {1, 2, 5}  # two tracks lead from frame 1 to 2


def test_constant_velocity_ties_frames_that_no_track_joins():
    """Several maps that dark pictures left: one that nothing tied was 36 m from the path."""
    frame, maps = np.repeat(np.arange(8), 3), np.repeat(np.arange(8) // 4, 3)
    observations = Observations(frame, 3 * maps + np.tile(np.arange(3), 8), np.zeros((24, 2)))
    torn = Scene(0.4 * np.arange(8), np.tile(np.eye(4), (8, 1, 1)), np.zeros((6, 3)), observations)
    assert np.flatnonzero(torn.torn(3)).tolist() == [3] and middles(torn) == {3, 4}
    stands = replace(torn, zero_motions=(ZeroMotion(4, 3, np.eye(4), np.ones(6)),))
    assert not stands.torn(3).any() and not middles(stands)
    loop = np.where(observations.landmark == 0, 0, -1)
    looped = replace(torn, loop=loop)
    assert np.flatnonzero(looped.torn(2)).tolist() == [3] and looped.torn(3)[:4].all()
