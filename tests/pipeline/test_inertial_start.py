"""Maps that lost their scale are put on the path of IMU and fixes, others stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
from brief_videos import first_frames
from fewer_features import fewer_features

import vgps
from vgps.imu.agreement import Agreement
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.pipeline.front_end import run_front_end
from vgps.pipeline.inertial_start import with_inertial_start
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import NoProgress

pytestmark = pytest.mark.slow

CONFIG = fewer_features(150)


@pytest.fixture(scope="module")
def front_end(data_dir):
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea", rig="rig_imu.yaml")
    return run_front_end(first_frames(recording, 80), CONFIG, NoProgress())


def shrunk(local_map):
    """A map whose steps get shorter from frame to frame, and whose points are near its beginning."""
    lost = local_map.snapshot()
    poses = lost.poses.copy()
    steps = np.diff(poses[:, :3, 3], axis=0) * 0.95 ** np.arange(len(poses) - 1)[:, None]
    poses[1:, :3, 3] = poses[0, :3, 3] + np.cumsum(steps, axis=0)
    near = poses[0, :3, 3] + 0.2 * (lost.points - poses[0, :3, 3])
    positions = Positions(np.arange(len(near)), near, lost.sigma_px)
    lost.apply(MapUpdate(first_frame=lost.first_frame, poses=poses, positions=positions))
    return lost


def test_maps_without_scale_are_put_on_the_path_of_imu_and_fixes(front_end, data_dir, monkeypatch):
    # rotations that follow the IMU say nothing against its clock
    monkeypatch.setattr("vgps.pipeline.inertial_start.imu_agreement", lambda *_: Agreement(None))
    (kept,) = front_end.maps
    lost = replace(front_end, maps=(shrunk(kept),))
    found = with_inertial_start(lost, CONFIG, NoProgress())
    (moved,) = found.maps
    truth = read_trajectory(data_dir / "kitti07" / "truth.tum").world_T_camera[kept.first_frame :]
    posed = np.isfinite(moved.poses[:, 0, 0])
    off = (moved.poses[:, :3, 3] - truth[: len(moved.poses), :3, 3])[posed]
    assert np.linalg.norm(off, axis=1).max() < 0.2
    known = np.isfinite(moved.points[:, 0]) & np.isfinite(kept.points[:, 0])
    assert np.median(np.linalg.norm(moved.points[known] - kept.points[known], axis=1)) < 3.0
    assert found.inertial and "the video lost its scale: " in found.warnings[-1]
    assert "imu.csv was shifted by -0.0" in found.warnings[-2]
    shift_s = found.recording.imu.t_s - front_end.recording.imu.t_s
    assert shift_s == pytest.approx(-0.009, abs=0.002)
    assert found.context(CONFIG).config.imu.knot_s == pytest.approx(0.1)
    assert front_end.context(CONFIG).config == CONFIG


def test_maps_with_scale_or_without_an_imu_stay_as_they_are(front_end):
    assert with_inertial_start(front_end, CONFIG, NoProgress()) is front_end
    lost = replace(front_end, maps=tuple(shrunk(one) for one in front_end.maps))
    alone = replace(lost, recording=replace(lost.recording, imu=None))
    assert with_inertial_start(alone, CONFIG, NoProgress()) is alone
    unused = replace(lost, fixes=replace(lost.fixes, used=np.zeros_like(lost.fixes.used)))
    assert with_inertial_start(unused, CONFIG, NoProgress()) is unused
    late = replace(lost.fixes, t_s=lost.fixes.t_s + 3.0)
    with_late_fixes = replace(lost, fixes=late)
    assert with_inertial_start(with_late_fixes, CONFIG, NoProgress()) is with_late_fixes
