from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ANTENNA, DrivingCamera, with_class_below

from vgps.config import Config
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import TimeOffset
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame
from vgps.model import FixClass
from vgps.online.fusion import live_fusion
from vgps.online.fusion.clock_watch import ClockWatch
from vgps.online.fusion.fit_job import FitJob
from vgps.online.fusion.live_fusion import LiveFusion
from vgps.online.fusion.live_time_offset import LiveTimeOffset
from vgps.online.fusion.unknown_time_offset import unknown_time_offset

LATE_S, CONFIG = 0.4, Config()


class Pipeline:
    """A stand-in for a frame pipeline that sees a drive as the video shows it, and gets its RTK-fixes."""

    def __init__(self, late_s=0.0, wrong_m=0.0, config=CONFIG, antenna=ANTENNA, drift=0.5, varying=0.0):
        drive = DrivingCamera(500, varying)
        self.path, self.true = drive.seen(np.random.default_rng(4), share=drift), drive.true
        fixes = drive.fixes([FixClass.RTK_FIX] * 50, wrong_m * np.ones((50, 3)))
        self.to_come = replace(fixes, t_s=fixes.t_s + late_s)
        self.t_s, self.warnings, self.camera = np.zeros(0), [], "given"
        given = np.zeros(3) if antenna is None else antenna
        self.fix_buffer = FixBuffer(Fixes.empty(), given, Config())
        self.fusion = LiveFusion(self, config, antenna_known=antenna is not None)
        self.begin()

    def begin(self):
        self.current = LocalMap(len(self.t_s), 5)
        self.current.apply(MapUpdate(aligned=True))

    def frame(self):
        """Refine the frames so far and add the next one; whether a fix comes with it."""
        if len(self.current.t_s) > 1:
            self.fusion.refine()
        last_s = self.t_s[-1] if len(self.t_s) else -1.0
        now_s = self.path.t_s[len(self.t_s)]
        came = (self.to_come.t_s > last_s + 1e-6) & (self.to_come.t_s <= now_s + 1e-6)
        self.current.apply(MapUpdate(frames=(NewFrame(now_s, self.path.poses[len(self.t_s)]),)))
        self.t_s = self.path.t_s[: len(self.t_s) + 1]
        self.fix_buffer.add(self.to_come.where(came), last_s)
        self.fusion.use_new_fixes()
        return bool(came.any())

    def scale(self, factor):
        """Scale the map, as stage C may."""
        self.path.poses[:, :3, 3] *= factor
        self.current.apply(MapUpdate(first_frame=0, poses=self.path.poses[: len(self.t_s)]))

    def error_m(self):
        to_world, centre = self.fusion.to_world(self.current), self.current.poses[-1, :3, 3]
        placed = to_world.scale * to_world.world_R_map @ centre + to_world.world_p_map
        return np.linalg.norm(placed - self.true[len(self.t_s) - 1, :3, 3])


@pytest.mark.slow
def test_a_fix_counts_with_the_frame_that_it_comes_with():
    """But for what it says of the clock, which waits for the fit to all."""
    known_clock = Config.model_validate({"sensors": {"estimate_time_offset": "no"}})
    pipeline, at_fixes, between = Pipeline(config=known_clock), [], []
    sigma_m = np.inf
    for _ in range(120):
        came, before_m = pipeline.frame(), sigma_m
        sigma_m = np.linalg.norm(pipeline.fusion.sigmas().position_m)
        if len(pipeline.t_s) > 60:
            (at_fixes if came else between).append(sigma_m - before_m)
    assert len(at_fixes) == 6 and max(at_fixes) < 0.0
    assert min(between) > 0.1 * max(at_fixes)


@pytest.mark.slow
def test_turns_show_an_antenna_of_which_nobody_knows_where_it_is_and_the_next_map_begins_with_it():
    """That of an RTK receiver is not the camera's: 1 m on each axis."""
    known, unknown = Pipeline(), Pipeline(antenna=None, varying=0.5)
    assert unknown.fusion.sensors.estimated_lever_arm is None  # no fix says yet of which kind it is
    for _ in range(30):
        unknown.frame()
    assert np.linalg.norm(unknown.fusion.sigmas().position_m) > np.sqrt(3.0)
    for _ in range(370):
        known.frame()
        unknown.frame()
    unknown.frame()
    found, sigma_m = unknown.fusion.sensors.estimated_lever_arm, unknown.fusion.sigmas().position_m
    assert (np.abs(found.camera_p_antenna - ANTENNA) < 3.0 * found.sigma_m).all()
    assert found.sigma_m[2] < 0.6 and sigma_m[2] == pytest.approx(1.0, abs=0.05)
    assert unknown.error_m() < 3.0 * np.linalg.norm(sigma_m)
    assert known.fusion.sensors.estimated_lever_arm is None
    unknown.begin()
    for _ in range(30):
        unknown.frame()
    assert unknown.fusion.sensors.estimated_lever_arm.sigma_m[2] < 0.6


@pytest.mark.slow
def test_a_receiver_that_has_its_first_rtk_fix_late_is_taken_for_one_with_an_antenna_of_its_own():
    pipeline, kinds = Pipeline(antenna=None), [FixClass.SINGLE] * 6 + [FixClass.RTK_FIX] * 44
    pipeline.to_come = DrivingCamera(500).fixes(kinds, np.zeros((50, 3)))
    for _ in range(60):
        pipeline.frame()
    before = pipeline.fusion.sensors.estimated_lever_arm.sigma_m
    for _ in range(10):
        pipeline.frame()
    after = pipeline.fusion.sensors.estimated_lever_arm.sigma_m
    assert before == pytest.approx(0.1, rel=0.05) and (after > 0.9).all()


@pytest.mark.slow
def test_a_clock_that_a_lever_arm_would_hide_is_found():
    pipeline = Pipeline(LATE_S, antenna=None, drift=0.1, varying=0.5)
    for _ in range(300):
        pipeline.frame()
    assert pipeline.fix_buffer.sensors.time_offset_s == pytest.approx(LATE_S, abs=0.1)
    found = pipeline.fusion.sensors.estimated_lever_arm
    assert (np.abs(found.camera_p_antenna - ANTENNA) < 3.0 * found.sigma_m).all()


@pytest.mark.slow
def test_the_pose_stays_where_it_was_when_stage_c_changes_the_map():
    pipeline = Pipeline()
    for _ in range(107):
        pipeline.frame()
    before_m = pipeline.error_m()
    pipeline.scale(1.1)
    assert not pipeline.frame()
    assert pipeline.error_m() < before_m + 0.1  # at the old scale 0.6 m


class Late(Future):
    """What a fit finds, and not in time."""

    def result(self, timeout=None):
        raise AssertionError("a live pose waited for it")


@pytest.mark.slow
def test_a_live_pose_does_not_wait_for_a_fit():
    pipeline = Pipeline(config=Config(online={"repeatable": False}))
    while pipeline.fusion.to_world(pipeline.current) is None:
        pipeline.frame()
    for _ in range(100):
        if pipeline.fusion._job is not None:
            pipeline.fusion._job.fit.exception()  # until it is found
        pipeline.frame()
    late = pipeline.fusion._job = FitJob(0.0, None, Late())
    while not pipeline.frame():
        pass
    assert pipeline.fusion._job is late
    assert pipeline.error_m() < 0.1  # by the fix that came meanwhile, too


def test_nor_for_the_first_one(monkeypatch):
    monkeypatch.setattr("vgps.online.fusion.live_fusion.begin", lambda *_: Late())
    pipeline = Pipeline(config=Config(online={"repeatable": False}))
    for _ in range(10):
        pipeline.frame()
    assert pipeline.fusion._job is not None
    assert pipeline.fusion.to_world(pipeline.current) is None


@pytest.mark.slow
def test_a_path_seen_by_a_refined_camera_is_fitted_before_the_next_pose():
    pipeline = Pipeline()
    while not (pipeline.frame() and len(pipeline.t_s) > 100):
        pass
    pipeline.fusion.refine()
    assert pipeline.fusion._job is not None  # a fit to the path as the old camera sees it
    scale = pipeline.fusion.to_world(pipeline.current).scale
    pipeline.scale(1.3)
    pipeline.camera = "refined"
    pipeline.fusion.refine()
    assert pipeline.fusion._job is None
    assert pipeline.fusion.to_world(pipeline.current).scale == pytest.approx(scale / 1.3, rel=0.02)


@pytest.mark.slow
def test_a_wrong_fix_has_its_verdict_after_two_frames():
    wrong_m = np.where(np.arange(50)[:, None] == 10, 8.0, 0.0)
    pipeline = Pipeline(wrong_m=wrong_m)
    while not pipeline.fix_buffer.assessment.rejected.any():
        pipeline.frame()
    assert pipeline.t_s[-1] == pytest.approx(pipeline.to_come.t_s[10] + 0.2)


@pytest.mark.slow
def test_of_ten_fixes_a_second_three_share_a_fit_unless_one_surprises(monkeypatch):
    """They count at once all the same."""
    newest_s, begun, wrong = [], live_fusion.begin, 72
    pipeline, wrong_m = Pipeline(), np.where(np.arange(90)[:, None] == wrong, 8.0, np.zeros(3))
    pipeline.to_come = DrivingCamera(500).fixes([FixClass.RTK_FIX] * 90, wrong_m, every=1)

    def begin(work, given, config):
        newest_s.append(given.fixes.t_s[-1])
        return begun(work, given, config)

    monkeypatch.setattr(live_fusion, "begin", begin)
    while len(pipeline.t_s) <= wrong:
        pipeline.frame()
        if len(pipeline.t_s) > 60:
            assert pipeline.error_m() < 0.05
    np.testing.assert_allclose(np.diff(newest_s[-10:]), 0.3)
    assert newest_s[-1] == pytest.approx(7.0)
    while not pipeline.fix_buffer.assessment.rejected.any():
        pipeline.frame()
    assert np.isclose(newest_s, 7.2).any() and pipeline.t_s[-1] == pytest.approx(7.4)
    assert pipeline.error_m() < 0.05


@pytest.mark.slow
def test_sigmas_cover_that_fixes_are_wrong_which_the_path_before_contradicts_until_right_ones_return():
    pipeline, drive = Pipeline(drift=0.2), DrivingCamera(500)
    kinds = np.repeat([FixClass.RTK_FIX, FixClass.DGPS, FixClass.RTK_FIX], [20, 8, 22]).tolist()
    wrong = np.zeros((50, 3))
    wrong[28:34] = [2.0, -1.5, 1.0]
    pipeline.to_come = with_class_below(drive.fixes(kinds, wrong))
    found = []
    for _ in range(400):
        pipeline.frame()
        if len(pipeline.t_s) > 20:
            found.append((pipeline.error_m(), np.linalg.norm(pipeline.fusion.sigmas().position_m)))
    error_m, sigma_m = np.array(found).T
    assert len(pipeline.warnings) == 1 and "fixes that came by 28.0 s" in pipeline.warnings[0]
    assert error_m.max() > 2.5 and (error_m < 2.0 * sigma_m + 0.1).all()
    assert error_m[-1] < 0.1 and sigma_m[-1] < 0.3


@pytest.mark.slow
def test_the_next_map_begins_with_the_time_offset_that_was_found():
    pipeline = Pipeline(LATE_S)
    for _ in range(400):
        pipeline.frame()
    assert pipeline.fix_buffer.sensors.time_offset_s == pytest.approx(LATE_S, abs=0.05)
    pipeline.begin()
    for _ in range(95):
        pipeline.frame()
        assert pipeline.fix_buffer.sensors.time_offset_s == pytest.approx(LATE_S, abs=0.05)
    assert not pipeline.fix_buffer.assessment.rejected.any()
    assert 1 <= len(pipeline.warnings) <= 3 and "older than their time stamps" in pipeline.warnings[-1]


@pytest.mark.slow
def test_displacements_correct_a_time_offset_that_fits_are_wrongly_sure_of(monkeypatch):
    def sure_of_none(*args):
        return replace(unknown_time_offset(*args), time_offset=LiveTimeOffset(0.0, 0.005, 0.005))

    monkeypatch.setattr("vgps.online.fusion.path_fusion.unknown_time_offset", sure_of_none)
    pipeline = Pipeline(LATE_S, drift=0.1)
    while not (told := [note for note in pipeline.warnings if "older than their time stamps" in note]):
        pipeline.frame()
    assert pipeline.fix_buffer.sensors.time_offset_s == pytest.approx(LATE_S, abs=0.03)
    for _ in range(100):
        pipeline.frame()
        assert pipeline.error_m() < 0.3  # 3.2 m by the wrong clock
        assert np.linalg.norm(pipeline.fusion.sigmas().position_m) < 0.7  # no doubt of the fixes is left
    assert pipeline.warnings[-1:] == told


def test_the_path_is_known_at_the_end_though_displacements_contradict_the_last_fit(monkeypatch):
    pipeline, shown = Pipeline(), iter([TimeOffset(LATE_S, 0.01)])
    for _ in range(60):
        pipeline.frame()
    monkeypatch.setattr(ClockWatch, "is_due", lambda *_: True)
    monkeypatch.setattr(ClockWatch, "confirmed", lambda *_: next(shown, None))
    pipeline.fusion.fuse_all()
    assert pipeline.fusion.world_path() is not None
    assert list(shown) == []


def test_a_path_is_fitted_anew_once_an_imu_is_left_out(monkeypatch):
    pipeline, given = Pipeline(), []
    for _ in range(25):
        pipeline.frame()
    before = pipeline.fusion.to_world(pipeline.current)
    pipeline.fusion._gravity = "wrong"
    pipeline.fusion.use_imu(None)
    kept = pipeline.fusion.to_world(pipeline.current)  # until there is a fit without it
    np.testing.assert_array_equal(kept.world_p_map, before.world_p_map)
    begun = live_fusion.begin
    monkeypatch.setattr(live_fusion, "begin", lambda *args: given.append(args[1]) or begun(*args))
    pipeline.frame()
    assert given[0].gravity is None and given[0].last is None  # which knew of it
    assert pipeline.error_m() < 0.1
