import numpy as np
import pytest

from vgps.config import OnlineConfig
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame, Similarity
from vgps.online.estimate import OnlineState
from vgps.online.fusion.inertial_bridge import BridgedPose
from vgps.online.fusion.pose_sigmas import UNKNOWN_SIGMAS
from vgps.online.pose_publisher import PosePublisher

CONFIG = OnlineConfig(bridge_s=0.35, blend_s=1.0, blend_m_s=2.0)
SPEED_M, INTERVAL_S = 0.8, 0.1


class Drive:
    """A stand-in for a frame pipeline that has only a newest map; the camera moves east."""

    def __init__(self):
        self.t_s = np.zeros(0)
        self.current = None
        self.to_world = Similarity(1.0, np.eye(3), np.zeros(3))
        self.publisher = PosePublisher(self, CONFIG)

    def frame(self, tracked=True, bridged=None):
        self.t_s = np.append(self.t_s, INTERVAL_S * len(self.t_s))
        if tracked:
            last = self.current.next_frame - 1
            for frame in range(last + 1, len(self.t_s)):
                pose = np.eye(4)
                pose[0, 3] = SPEED_M * frame
                self.current.apply(MapUpdate(frames=(NewFrame(self.t_s[frame], pose),)))
        return self.publish(bridged)

    def publish(self, bridged=None):
        placed = self.current is not None and self.current.aligned
        return self.publisher.publish(len(self.t_s) - 1, self.to_world if placed else None, bridged)

    def begin(self, aligned=True):
        self.current = LocalMap(len(self.t_s), 5)
        self.current.apply(MapUpdate(aligned=aligned))


def kinds(followed):
    return [event.kind for event in followed.events]


def test_states_from_start_to_alignment_and_their_events():
    drive = Drive()
    assert drive.frame(tracked=False).state is OnlineState.STARTING
    drive.begin(aligned=False)
    found = drive.frame()
    assert found.state is OnlineState.UNALIGNED and np.isnan(found.global_T_camera).all()
    drive.current.apply(MapUpdate(aligned=True))
    found = drive.frame()
    assert found.state is OnlineState.TRACKED and kinds(found) == ["aligned"]
    assert found.global_T_camera[0, 3] == pytest.approx(2 * SPEED_M)


def test_a_gap_is_bridged_at_constant_velocity_then_lost_then_found():
    drive = Drive()
    drive.begin()
    for _ in range(5):
        drive.frame()
    dark = [drive.frame(tracked=False) for _ in range(6)]
    assert [found.state for found in dark] == [OnlineState.BRIDGED] * 3 + [OnlineState.LOST] * 3
    east = [found.global_T_camera[0, 3] for found in dark[:3]]
    assert east == pytest.approx([SPEED_M * k for k in (5, 6, 7)])
    assert np.isnan(dark[3].global_T_camera).all() and np.isnan(dark[3].local_T_camera).all()
    assert [kinds(found) for found in dark] == [[], [], [], ["lost"], [], []]
    again = drive.frame()
    assert again.state is OnlineState.TRACKED and kinds(again) == ["found"]


def test_an_imu_bridges_longer_gaps_and_the_start_of_the_next_map():
    drive = Drive()
    drive.begin()
    for _ in range(5):
        drive.frame()
    by_imu = np.eye(4)
    by_imu[1, 3] = 7.0
    bridged = BridgedPose(by_imu, UNKNOWN_SIGMAS)
    dark = [drive.frame(tracked=False, bridged=bridged) for _ in range(6)]
    drive.begin(aligned=False)
    dark.append(drive.frame(tracked=False, bridged=bridged))
    assert {found.state for found in dark} == {OnlineState.BRIDGED}
    assert all((found.global_T_camera == by_imu).all() and not kinds(found) for found in dark)
    np.testing.assert_array_equal(dark[-1].local_T_camera, by_imu)


@pytest.mark.slow
def test_after_a_correction_the_smooth_pose_nears_the_corrected_one_without_jumps():
    drive = Drive()
    drive.begin()
    for _ in range(5):
        last = drive.frame()
    drive.to_world = Similarity(1.0, np.eye(3), np.array([0.0, 10.0, 0.0]))
    away = []
    for _ in range(150):
        t = len(drive.t_s)
        drive.t_s = np.append(drive.t_s, INTERVAL_S * t)
        pose = np.eye(4)
        pose[0, 3] = SPEED_M * t
        drive.current.apply(MapUpdate(frames=(NewFrame(drive.t_s[-1], pose),)))
        found = drive.publish()
        assert kinds(found) == (["corrected"] if not away else [])
        step = np.linalg.norm(found.local_T_camera[:3, 3] - last.local_T_camera[:3, 3])
        assert step <= SPEED_M + 2.0 * INTERVAL_S + 1e-9
        away.append(np.linalg.norm(found.local_T_camera - found.global_T_camera))
        last = found
    assert away[0] > 9.0 and (np.diff(away) < 1e-9).all() and away[-1] < 0.01


def test_a_new_map_resets_the_smooth_pose():
    drive = Drive()
    drive.begin()
    for _ in range(3):
        drive.frame()
    drive.begin()
    drive.current.apply(MapUpdate(frames=(NewFrame(0.3, np.eye(4)),)))
    drive.t_s = np.append(drive.t_s, 0.3)
    found = drive.publish()
    np.testing.assert_array_equal(found.local_T_camera, found.global_T_camera)
