"""An IMU that contradicts a live video, on a map whose motion is known exactly."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from inertial import MOUNT, exact_log, path_of, swinging_motion

from vgps.config import Config
from vgps.imu.agreement import Agreement
from vgps.model import Rig
from vgps.online import live_imu
from vgps.online.live_imu import LiveImu

MOTION = swinging_motion()
PATH, LOG = path_of(MOTION), exact_log(MOTION)
GYRO = object()


class Session:
    """A stand-in for frame pipeline and fusion: frames come at 10 Hz, and a wrong map lasts for a while."""

    def __init__(self, log, wrong_until_s=0.0):
        self.imu = LiveImu(log, Rig(imu=MOUNT), Config())
        self.gyro, self.warnings, self.new_maps, self.used = GYRO, [], 0, [self.imu.at_camera]
        self.wrong_until_s = wrong_until_s

    def start_anew(self):
        self.new_maps += 1

    def use_imu(self, imu):
        self.used.append(imu)

    def run(self, until_s):
        for frames in range(2, int(10 * until_s) + 2):
            self.t_s, poses = PATH.t_s[:frames], PATH.world_T_camera[:frames]
            if self.t_s[-1] < self.wrong_until_s:
                poses = np.concatenate([poses[:1]] * frames)
                poses[1::2, :3, :3] = poses[0, :3, :3] @ np.diag([1.0, -1.0, -1.0])
            self.current = SimpleNamespace(
                first_posed=0, first_frame=0, t_s=self.t_s, poses=poses, aligned=True
            )
            self.imu.check(self, self)
        return self


@pytest.mark.slow
def test_a_right_imu_stays_and_a_map_that_is_wrong_for_a_moment_does_not_matter():
    session = Session(LOG, wrong_until_s=4.15).run(6.0)
    assert session.gyro is GYRO and session.imu.log is LOG and not session.warnings and len(session.used) == 1
    assert session.imu._span_s == 10.0  # 5 s fitted, 4 s did not


def test_rates_in_degrees_are_left_out_with_the_map_that_they_bent():
    session = Session(replace(LOG, rate_rad_s=np.degrees(LOG.rate_rad_s))).run(6.0)
    (note,) = session.warnings
    assert note.startswith("imu.csv is left out from 5.5 s on: it turns 57.3 times as far as the video")
    assert session.imu.log is None and session.gyro is None and session.new_maps == 1
    assert session.used[1:] == [None]


@pytest.mark.slow
def test_a_reversed_accelerometer_leaves_the_rotations():
    session = Session(replace(LOG, force_m_s2=-LOG.force_m_s2)).run(6.0)
    (note,) = session.warnings
    assert note.startswith("imu.csv only predicts rotations from 5.5 s on") and "with -ax, -ay, -az" in note
    assert session.imu.log is None and session.gyro is GYRO and session.used[1:] == [None]


def test_a_clock_that_is_off_is_corrected(monkeypatch):
    monkeypatch.setattr(live_imu, "agreement", lambda *_: Agreement(None, -0.3, 1e-4))
    session = Session(LOG).run(6.0)
    (note,) = session.warnings
    assert note.startswith("imu.csv is shifted by -0.3000 s from 5.5 s on") and session.gyro is not GYRO
    np.testing.assert_allclose(session.imu.log.t_s, LOG.t_s - 0.3)
    assert session.used[1:] == [session.imu.at_camera] and not session.new_maps


def test_without_an_imu_nothing_is_compared():
    session = Session(None)
    assert session.imu.at_camera is None and not session.run(1.0).warnings
