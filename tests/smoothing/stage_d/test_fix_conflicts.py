"""Conflicts between RTK-fixes in stage D: a drive with exact truth, some of whose fixes are off."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from brief_videos import first_frames
from fewer_features import fewer_features
from synthetic_bundle import ANTENNA
from synthetic_map import away, context, map_of, scene

import vgps
from scripts.experiments.fault_matrix.faults import FAULTS
from vgps.config import Config
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.outlier_detection import FixAssessment
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import FixClass
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_d import batch, fix_conflicts
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.solution import Verdict

pytestmark = pytest.mark.slow

SHARP = {"batch": {"video_sigma_scale": 1.0}}  # a video as exact as this one
SHIFT = np.array([0.2, 0.16, -0.24])  # verdicts between the rounds find 0.4 m


@pytest.fixture(autouse=True)
def every_fix_is_compared(monkeypatch):
    """The drive takes six seconds, with a fix every 0.4 s."""
    monkeypatch.setattr(fix_conflicts, "_INTERVAL_S", 0.4)


def log(*wrong, shift=SHIFT, at=None):
    """RTK-fixes on the drive; those of the rows ``wrong`` are off."""
    fixes = scene()[3]
    n = len(fixes)
    place = fixes.world_p_fix.copy()
    place[list(wrong)] += shift
    return replace(
        fixes,
        world_p_fix=place,
        r_m=np.full(n, 0.07),
        h_m=np.full(n, 0.05),
        lower_r_m=np.full(n, 2.4),
        lower_h_m=np.full(n, 6.5),
        fix_class=np.full(n, CLASSES.index(FixClass.RTK_FIX)),
    )


def result(fixes: Fixes, **settings):
    """Return stage D's result and its mean error."""
    problem, true, _, _ = scene(disturbed=0.05)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    config = Config.model_validate(SHARP | settings)
    found = optimise_batch(made, fixes, Sensors.fixed(ANTENNA), context(config))
    return found, away(found.trajectory.world_T_camera, true)


def sigmas(found):
    return np.sqrt(np.trace(found.covariance[:, 3:, 3:], axis1=1, axis2=2))


def test_a_run_of_wrong_fixes_is_found_and_no_longer_bends_the_path(monkeypatch):
    rows = [5, 6, 7, 8]
    found, error = result(log(*rows))
    (conflict,) = found.conflicts
    assert conflict.wrong.tolist() == rows and conflict.probability < 0.05
    np.testing.assert_allclose(conflict.error_m, np.tile(SHIFT, (4, 1)), atol=0.05)
    assert found.assessment.down_classed[rows].all() and not found.assessment.rejected.any()
    assert conflict.note in found.warnings
    monkeypatch.setattr(batch, "find_conflicts", lambda *_: ())
    assert error < 0.2 * result(log(*rows))[1]


def test_fixes_that_are_not_used_contradict_none():
    """They have no factor: a run whose video fell to pieces ended with a traceback."""
    rows = [5, 6, 7, 8]
    fixes = log(*rows)
    found, error = result(replace(fixes, used=~np.isin(np.arange(len(fixes)), rows)))
    assert not found.conflicts and error < 0.1


def test_right_fixes_do_not_contradict_each_other():
    found, error = result(log())
    assert found.conflicts == () and error < 0.01
    assert not any("contradict each other" in text for text in found.warnings)


def test_where_either_half_may_be_right_the_sigmas_cover_both():
    fixes = log(*range(8, 15))
    found, error = result(fixes.where(np.arange(14)))
    (conflict,) = found.conflicts
    assert conflict.probability > 0.45
    size = np.linalg.norm(SHIFT)
    assert min(error, abs(error - size)) < 0.05
    assert np.all(sigmas(found) > 0.6 * size)
    plain, _ = result(log().where(np.arange(14)))
    assert np.all(sigmas(plain) < 0.2 * size)


def test_frames_before_and_after_the_fixes_hang_on_them_too():
    fixes = log(*range(8, 15)).where(np.r_[2:14])
    found, _ = result(fixes)
    (conflict,) = found.conflicts
    assert conflict.frames == (0, 59) and np.all(sigmas(found) > 0.6 * np.linalg.norm(SHIFT))


def test_frames_hang_on_the_stretch_of_fixes_around_them():
    fixes = log(*range(9, 12))
    found, _ = result(fixes.where(np.r_[0:4, 7:15]), gps={"memory": {"max_gap_s": 1.0}})
    (conflict,) = found.conflicts
    assert conflict.frames == (12, 59)  # from the last fix before the gap on


def test_windows_find_a_run_that_is_longer_than_they_are(monkeypatch):
    monkeypatch.setattr(fix_conflicts, "_WINDOW", 8)
    found, error = result(log(*range(4, 10)))
    (conflict,) = found.conflicts
    assert conflict.wrong.tolist() == list(range(4, 10)) and error < 0.05


@pytest.mark.parametrize("located", [True, False])
def test_fixes_between_those_compared_have_the_error_of_one_of_them(monkeypatch, located):
    monkeypatch.setattr(fix_conflicts, "_INTERVAL_S", 0.8)
    if not located:  # nothing tells where the error begins
        steps = fix_conflicts._Video.steps
        none = lambda video, rows: np.zeros((len(rows), 3)) if len(rows) > 8 else steps(video, rows)  # noqa: E731
        monkeypatch.setattr(fix_conflicts._Video, "steps", none)
    rows = [5, 6, 7, 8, 9]
    found, _ = result(log(*rows))
    (conflict,) = found.conflicts
    unclear = np.isnan(conflict.error_m[:, 0])
    if located:
        assert conflict.wrong.tolist() == rows and not unclear.any()
    else:
        assert conflict.wrong[unclear].tolist() == [5, 9]
        assert found.assessment.rejected[[5, 9]].all()


def test_verdicts_that_took_the_wrong_side_are_reversed(monkeypatch):
    """Of fifteen fixes five are wrong; outlier detection took the others for RTK-floats."""
    fixes, wrong = log(0, 1, 2, 3, 4), np.arange(15) < 5
    before = FixAssessment(np.where(wrong, 1.0, 0.0), np.where(wrong, 0.0, 1.0))
    monkeypatch.setattr(batch, "assess_offsets", lambda *_: before)
    found, error = result(fixes)
    np.testing.assert_array_equal(found.assessment.down_classed, wrong)
    assert error < 0.05


@pytest.mark.parametrize("refused", [[0, 1, 2, 3], range(7)])
def test_what_other_fixes_refute_stays_rejected(monkeypatch, refused):
    """Of seven RTK-fixes before coarse ones four are wrong, or all: verdicts know it by the coarse ones."""
    fixes, verdict = log(*refused), np.where(np.isin(np.arange(15), refused), 0.0, 1.0)
    fix_class = np.where(np.arange(15) < 7, fixes.fix_class, CLASSES.index(FixClass.SINGLE))
    monkeypatch.setattr(batch, "assess_offsets", lambda *_: FixAssessment(verdict, np.zeros(15)))
    found, _ = result(replace(fixes, fix_class=fix_class))
    assert found.conflicts == () and np.flatnonzero(found.assessment.rejected).tolist() == list(refused)


@pytest.mark.parametrize(("rows", "told"), [([5, 6, 7], False), (range(8, 15), True)])
def test_what_verdicts_say_already_is_told_if_it_may_be_otherwise(monkeypatch, rows, told):
    wrong = np.isin(np.arange(15), rows)
    before = FixAssessment(np.where(wrong, 0.0, 1.0), np.zeros(15))
    monkeypatch.setattr(batch, "assess_offsets", lambda *_: before)
    assert bool(result(log(*rows))[0].conflicts) == told


def test_fixes_far_apart_in_time_are_not_compared():
    fixes = log(*range(8, 15))
    apart = fixes.where(np.r_[0:4, 11:15])
    found, _ = result(apart, gps={"memory": {"max_gap_s": 2.0}})
    assert found.conflicts == ()


@pytest.mark.parametrize("settings", [{"outliers": {"enabled": False}}, {"gps": {"model": "cauchy"}}])
def test_where_fixes_are_not_judged_there_are_no_conflicts(settings):
    assert result(log(5, 6, 7, 8), **settings)[0].conflicts == ()


def test_what_the_path_may_err_by_is_no_error_of_fixes():
    assert result(log(5, 6, 7, 8), gps={"memory": {"path_share": 0.5}})[0].conflicts == ()


def test_coarse_fixes_are_not_compared():
    fixes = log(5, 6, 7, 8)
    coarse = replace(fixes, fix_class=np.full(len(fixes), CLASSES.index(FixClass.SINGLE)))
    assert result(coarse)[0].conflicts == ()


def test_wrong_integers_on_a_real_drive_no_longer_bend_its_path(data_dir: Path, kitti07_fixed) -> None:
    """Of 12 RTK-fixes four are 0.54 m off; without the check the path follows them by 0.2 m."""
    recording = first_frames(vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea"), 120)
    fault = next(one for one in FAULTS if one.name == "wrong-integers")
    faulty = fault.into(recording, np.random.default_rng(0))
    found = vgps.smooth(faulty.recording, fewer_features(250, intrinsics={"refine": "no"}))
    assert any("RTK-fixes contradict each other" in text for text in found.warnings)
    assert not any("RTK-fixes contradict each other" in text for text in kitti07_fixed.warnings)
    wrong = np.isin(found.fixes.verdict, [Verdict.DOWN_CLASSED, Verdict.REJECTED])
    assert wrong[faulty.wrong].all() and np.sum(wrong & ~faulty.wrong) <= 1
    assert away(found.world_T_camera, kitti07_fixed.world_T_camera[:120]) < 0.08
