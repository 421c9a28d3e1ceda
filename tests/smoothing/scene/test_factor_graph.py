"""Which frames the motion holds beside what they see."""

import numpy as np
from gtsam.symbol_shorthand import X

from vgps.config import Config
from vgps.gps.sensors import Sensors
from vgps.mapping.zero_motion import ZeroMotion
from vgps.smoothing.scene.factor_graph import other_pose_factors
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations

SEEN = (0, 2, 3, 3, 3, 0, 3, 3)  # features in each frame


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


def test_constant_velocity_holds_frames_of_two_features():
    graph = other_pose_factors(scene(), Sensors.fixed(np.zeros(3)), Config())
    held = {tuple(graph.at(row).keys()) for row in range(graph.size()) if len(graph.at(row).keys()) == 3}
    assert held == {tuple(X(frame + k) for k in (-1, 0, 1)) for frame in (1, 2, 5)}
