from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ANTENNA, DrivingCamera, fit_input, fixed_then_float

from vgps.config import Config
from vgps.gps.sensors import TimeOffset
from vgps.model import FixClass
from vgps.online.fusion import clock_profile, fusion_fit
from vgps.online.fusion.clock_profile import profiled_time_offset
from vgps.online.fusion.live_time_offset import LiveTimeOffset
from vgps.online.fusion.path_fusion import fuse

CONFIG = Config()
UNSURE = LiveTimeOffset(0.0, 0.3, 0.3)


def profiled(late_s, believed=UNSURE, config=CONFIG, seed=1):
    """What fits at several time offsets prefer on a drive with two RTK-fixes before RTK-floats."""
    drive = DrivingCamera(400)
    fixes = drive.fixes(*fixed_then_float(2, 38, [0.3, -0.4, 1.0]))
    path = drive.seen(np.random.default_rng(seed), share=0.3)
    fixes = replace(fixes, t_s=fixes.t_s + late_s)
    fused = replace(fuse(path, fixes, ANTENNA, config, None), time_offset=believed)
    return profiled_time_offset(path, fixes, ANTENNA, fused, config)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("late_s", [-0.3, 0.25])
def test_a_clock_that_makes_floats_walk_is_found(late_s, seed):
    found = profiled(late_s, seed=seed)
    assert found.time_offset_s == pytest.approx(late_s, abs=0.02) and found.sigma_s < 0.2


@pytest.mark.parametrize("by_displacements", [TimeOffset(0.2, 0.01), None])
def test_a_fit_that_watches_the_clock_asks_other_fits_where_displacements_show_nothing(
    monkeypatch, by_displacements
):
    by_fits = TimeOffset(0.3, 0.02)
    monkeypatch.setattr(fusion_fit, "shown_time_offset", lambda *_: by_displacements)
    monkeypatch.setattr(fusion_fit, "profiled_time_offset", lambda *_: by_fits)
    drive = DrivingCamera(40)
    fixes = drive.fixes([FixClass.RTK_FIX] * 4, np.zeros((4, 3)))
    last = fuse(drive.seen(), fixes, ANTENNA, CONFIG, None)
    given = fit_input(drive.seen(), 40, fixes, last)
    assert fusion_fit.fit(given, CONFIG).shown is None
    shown = fusion_fit.fit(replace(given, watches_clock=True), CONFIG).shown
    assert shown is (by_displacements or by_fits)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_clocks_that_agree_are_left_alone(seed):
    assert profiled(0.0, seed=seed) is None


@pytest.mark.slow
def test_what_the_fit_knows_as_well_is_not_looked_for():
    assert profiled(0.25, believed=LiveTimeOffset(0.0, 0.1, 0.1)) is None
    assert profiled(0.25, believed=LiveTimeOffset(0.25, 0.2, 0.2)) is None
    held = Config.model_validate({"sensors": {"estimate_time_offset": "no"}})
    assert profiled(0.25, config=held) is None


def test_a_fit_that_fails_tells_nothing(monkeypatch):
    drive = DrivingCamera(40)
    fixes = drive.fixes([FixClass.RTK_FIX] * 4, np.zeros((4, 3)))
    fused = replace(fuse(drive.seen(), fixes, ANTENNA, CONFIG, None), time_offset=UNSURE)

    def fails(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(clock_profile, "fuse", fails)
    assert profiled_time_offset(drive.seen(), fixes, ANTENNA, fused, CONFIG) is None


def test_a_straight_tells_nothing():
    drive = DrivingCamera(120)
    drive.true[:, :3, :3] = drive.true[0, :3, :3]
    drive.true[:, :3, 3] = np.linspace(0.0, 96.0, 120)[:, None] * drive.true[0, :3, 2]
    fixes = drive.fixes(*fixed_then_float(2, 10, [0.3, -0.4, 1.0]))
    fixes = replace(fixes, t_s=fixes.t_s + 0.3)
    fused = fuse(drive.seen(), fixes, ANTENNA, CONFIG, None)
    assert fused.time_offset.sigma_s > 0.3
    assert profiled_time_offset(drive.seen(), fixes, ANTENNA, fused, CONFIG) is None
