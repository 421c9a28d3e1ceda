from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_fixes import fixes_of_size
from walks import ToAndFro

import vgps
from vgps.config import DriftConfig, WindowConfig
from vgps.geodesy import to_geodetic
from vgps.gps.fixes import Fixes
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame
from vgps.model import FixClass
from vgps.online.estimate import OnlineState
from vgps.online.pose_publisher import PublishedPose
from vgps.online.pose_sigmas import PoseUncertainty
from vgps.online.replay import fixes_of
from vgps.smoothing.covariance import region_sigmas

INTERVAL_S, SPEED_M = 0.1, 0.8
NOWHERE = np.full((4, 4), np.nan)


class Drive:
    """Stand-in for a frame pipeline in a wide bend, with an RTK-fix every second; stage C every 15 frames."""

    def __init__(self, delay_frames=0):
        self.t_s = np.zeros(0)
        self.current = LocalMap(0, 5)
        self.current.apply(MapUpdate(aligned=True))
        self.sensors = SimpleNamespace(camera_p_antenna=np.zeros(3), time_offset_s=0.0)
        self.fix_buffer = self
        self.fixes = Fixes.empty()
        self.uncertainty = PoseUncertainty(self, vgps.Config(window=WindowConfig(delay_frames=delay_frames)))

    def usable(self, until_s):
        return self.fixes.until(until_s)

    def fix(self):
        one, place = np.ones(1), np.zeros((1, 3))
        float_ = {"lower_r_m": 2.4 * one, "lower_h_m": 6.5 * one, "sigma_m": place}
        size = 0.07 * one, 0.05 * one
        more = fixes_of_size(self.t_s[-1:] - 0.03, place, *size, correlation_s=10.0 * one, **float_)
        self.fixes, _ = self.fixes.merged(more)

    def frame(self, fixes=True, moved=0.01, tracked=True):
        frame = len(self.t_s)
        self.t_s = np.append(self.t_s, INTERVAL_S * frame)
        if tracked:
            pose, angle = np.eye(4), SPEED_M * frame / 60.0
            pose[:2, 3] = 60.0 * np.sin(angle), 60.0 * (1.0 - np.cos(angle))
            self.current.apply(MapUpdate(frames=(NewFrame(self.t_s[-1], pose),)))
        correction = np.full(6, moved) * (0.1, 0.1, 0.1, 1.0, 1.0, 1.0) if frame % 15 == 1 else None
        state = OnlineState.TRACKED if tracked else OnlineState.BRIDGED
        pose = self.current.poses[-1]
        found = self.uncertainty.sigmas(
            PublishedPose(state, pose, pose, (), correction if frame > 1 else None)
        )
        if fixes and frame % 10 == 5:
            self.fix()
        self.uncertainty.record_fixes()
        return found

    def frames(self, count, **options):
        return np.array([self.frame(**options).position_m for _ in range(count)])


def test_sigmas_grow_in_an_outage_and_shrink_after_it():
    drive = Drive()
    before = drive.frames(300)[-60:]
    silent = drive.frames(300, fixes=False)
    after = drive.frames(60)[-1]
    assert (before[:, :2] < 1.0).all() and (before > 0.01).all()
    across_pauses = np.linalg.norm(silent[29::30], axis=1)
    assert (np.diff(across_pauses) > 0).all() and across_pauses[-1] > 5.0
    assert (after < 0.2 * silent[-1]).all()


def test_a_fix_counts_once_stage_c_has_moved_the_pose():
    drive = Drive()
    drive.frames(46)  # stage C moved frame 46 - 1
    waiting = drive.frames(15)[:, 0]  # fixes come in frames 55 and 65
    assert (np.diff(waiting) > 0).all()
    assert drive.frame().position_m[0] < waiting[-1]


def test_fixes_that_came_after_stage_c_do_not_count_yet():
    drive, later = Drive(), Drive()
    for each in (drive, later):
        each.frames(91, fixes=False)
    drive.fix()
    drive.uncertainty.record_fixes()
    later.uncertainty.record_fixes()
    later.fix()
    drive.frames(15, fixes=False)
    assert drive.frame().position_m[0] < 0.2 * later.frames(1)[0, 0]


def test_a_fix_does_not_count_in_stage_c_started_before_it():
    quick, slow = Drive(), Drive(delay_frames=8)
    for each in (quick, slow):
        each.frames(102, fixes=False)
        each.fix()
        each.frames(4, fixes=False)  # stage C began in frame 98 at the latest
    assert quick.frame().position_m[0] < 0.2 * slow.frame().position_m[0]


def test_a_correction_of_many_sigmas_raises_them_for_a_time():
    calm, shaken = Drive(), Drive()
    for each in (calm, shaken):
        each.frames(151)
    at_once = shaken.frame(moved=30.0).position_m / calm.frame().position_m
    assert (at_once > 3.0).all()
    later = shaken.frames(600)[-1] / calm.frames(600)[-1]
    assert (later < 1.0 + 0.1 * (at_once - 1.0)).all() and (later >= 1.0).all()


def test_sigmas_of_a_bridged_frame_grow_by_the_motion_model():
    drive = Drive()
    last = drive.frames(107)[-1]  # just corrected
    bridged = drive.frames(10, tracked=False)
    # white noise of 2 m/s^2/sqrt(Hz) for a second: 2 / sqrt(3) m
    np.testing.assert_allclose(bridged[-1] ** 2 - last**2, 4.0 / 3.0, rtol=1e-6)


def test_without_a_pose_there_are_no_sigmas():
    drive = Drive()
    nowhere = PublishedPose(OnlineState.LOST, NOWHERE, NOWHERE, ())
    drive.frames(3)
    assert np.isnan(drive.uncertainty.sigmas(nowhere).position_m).all()


def walked_with_float_fixes(walk, frames, seed):
    """Errors in sigmas (n, 3) of a walk whose fixes err by the region and correlation time of RTK-float."""
    rng, errors = np.random.default_rng(seed), np.zeros(3)
    template, opened = next(fixes_of(walk.opened.gps)), walk.opened
    # aligned tracks of rendered pictures let a camera drift less than real ones do
    config = vgps.Config(drift=DriftConfig(scale_sigma=0.002, rotation_sigma_deg=0.03))
    smoother, ratios = vgps.OnlineSmoother(opened.camera, opened.rig, config), []
    region = config.gps.regions[FixClass.RTK_FLOAT]
    one = np.ones(1)
    (sigma,) = region_sigmas(fixes_of_size(one, np.zeros((1, 3)), region.r_m * one, region.h_m * one))
    for index in range(frames):
        t_s, true = index / 15, walk.true[walk.row(index)]
        if index % 15 == 0:
            kept = np.exp(-2.0 / region.correlation_s) if index else 0.0
            errors = kept * errors + np.sqrt(1.0 - kept**2) * rng.standard_normal(3)
            exact = index < 60
            antenna = true[:3, 3] + true[:3, :3] @ opened.rig.camera_p_antenna
            place = to_geodetic(opened.rig.world_origin, antenna + (0.0 if exact else 1.0) * sigma * errors)
            latitude, longitude, height = (float(x) for x in place)
            kind = FixClass.RTK_FIX if exact else FixClass.RTK_FLOAT
            fix = template._replace(
                t_s=t_s, latitude_deg=latitude, longitude_deg=longitude, height_m=height, fix_class=kind
            )
            smoother.add_fix(fix)
        estimate = smoother.add_frame(t_s, walk.images[walk.row(index)])
        smoother.refine()
        if estimate.posed:
            ratios.append((estimate.global_T_camera[:3, 3] - true[:3, 3]) / estimate.sigma_position_m)
    return np.array(ratios)


@pytest.mark.slow
def test_sigmas_are_of_the_order_of_the_errors(recording):
    walk = ToAndFro(recording)
    nees = [np.mean(walked_with_float_fixes(walk, 270, seed) ** 2) for seed in range(2)]
    assert 0.05 < np.mean(nees) < 3.0
