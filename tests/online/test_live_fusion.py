from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ANTENNA, DrivingCamera

from vgps.config import Config
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame
from vgps.model import FixClass
from vgps.online.live_fusion import LiveFusion

LATE_S = 0.4


class Pipeline:
    """A stand-in for a frame pipeline that sees a drive as the video shows it, and gets its RTK-fixes."""

    def __init__(self, late_s=0.0):
        drive = DrivingCamera(500)
        self.path = drive.seen(np.random.default_rng(4), share=0.5)
        fixes = drive.fixes([FixClass.RTK_FIX] * 50, np.zeros((50, 3)))
        self.to_come = replace(fixes, t_s=fixes.t_s + late_s)
        self.t_s, self.warnings = np.zeros(0), []
        self.fix_buffer = FixBuffer(Fixes.empty(), ANTENNA, Config())
        self.fusion = LiveFusion(self, Config())
        self.begin()

    @property
    def sensors(self):
        return self.fix_buffer.sensors

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


def test_a_fix_counts_with_the_frame_that_it_comes_with():
    pipeline, at_fixes, between = Pipeline(), [], []
    sigma_m = np.inf
    for _ in range(120):
        came, before_m = pipeline.frame(), sigma_m
        sigma_m = np.linalg.norm(pipeline.fusion.sigmas().position_m)
        if len(pipeline.t_s) > 60:
            (at_fixes if came else between).append(sigma_m - before_m)
    assert len(at_fixes) == 6 and max(at_fixes) < 0.0
    assert min(between) > 0.1 * max(at_fixes)


def test_the_next_map_begins_with_the_time_offset_that_was_found():
    pipeline = Pipeline(LATE_S)
    for _ in range(400):
        pipeline.frame()
    assert pipeline.sensors.time_offset_s == pytest.approx(LATE_S, abs=0.05)
    pipeline.begin()
    for _ in range(95):
        pipeline.frame()
        assert pipeline.sensors.time_offset_s == pytest.approx(LATE_S, abs=0.05)
    assert not pipeline.fix_buffer.assessment.rejected.any()
    assert 1 <= len(pipeline.warnings) <= 3 and "older than their time stamps" in pipeline.warnings[-1]
