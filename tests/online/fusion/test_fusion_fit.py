from dataclasses import replace

import numpy as np
import pytest
from fused_drives import DrivingCamera, fit_input, fixed_then_float

import vgps
from vgps.model import FixClass
from vgps.online.fusion.fusion_equations import TIME_OFFSET
from vgps.online.fusion.fusion_fit import fit, fit_with_verdicts, newest_fit

CONFIG = vgps.Config()
FIRST, AFTER = 305, 312  # frames at the last whole fit and now; there is a fix at frame 310
DELAY_S = 0.8  # with which the one at frame 300 has come by now, but not by the last fit


@pytest.fixture(scope="module", params=[40, 20], ids=["RTK-fix", "RTK-float"])
def drive(request):
    """A drive, what the video sees of it, and its fixes."""
    drive = DrivingCamera(400)
    kinds, wrong = fixed_then_float(request.param, 40 - request.param, [0.5, 0.5, 1.0])
    return drive, drive.seen(np.random.default_rng(4), share=0.5), drive.fixes(kinds, wrong)


@pytest.mark.slow
@pytest.mark.parametrize("delay_s", [0.0, DELAY_S])
def test_new_fixes_count_at_once_as_in_a_whole_fit(drive, delay_s):
    _, path, fixes = drive
    last = None
    for _ in range(12):  # until the errors that are learned are those in use
        last = fit(fit_input(path, FIRST, fixes, last, delay_s), CONFIG).fused
    now = fit_input(path, AFTER, fixes, last, delay_s)
    newest, whole = newest_fit(now, CONFIG), fit(now, CONFIG).fused
    assert newest is not None and len(newest.nodes.t_s) < 6 < len(whole.nodes.t_s)
    ends = [one.to_world(now.path) for one in (newest, whole, last)]
    position = [one.scale * one.world_R_map @ now.path.poses[-1, :3, 3] + one.world_p_map for one in ends]
    correction = np.linalg.norm(position[1] - position[2])
    assert np.linalg.norm(position[0] - position[1]) < 0.25 * correction
    sigmas = [np.sqrt(np.diag(one.covariance_at_end(now.path, CONFIG))) for one in (newest, whole)]
    np.testing.assert_allclose(sigmas[0], sigmas[1], rtol=0.1)
    stated_s = newest.covariance[TIME_OFFSET, TIME_OFFSET] ** 0.5
    assert (
        newest.time_offset.sigma_s == pytest.approx(stated_s) and stated_s > 0.999 * last.time_offset.sigma_s
    )


def test_a_fit_finds_what_the_next_one_begins_with(drive):
    _, path, fixes = drive
    last = fit(fit_input(path, FIRST, fixes), CONFIG).fused
    found = [
        newest_fit(fit_input(path, AFTER, fixes, one), CONFIG) for one in (last, replace(last, carried=None))
    ]
    assert last.carried is not None
    np.testing.assert_allclose(found[0].state.values, found[1].state.values, atol=1e-9)


def test_without_new_fixes_there_is_nothing_to_fit(drive):
    _, path, fixes = drive
    last = fit(fit_input(path, FIRST, fixes), CONFIG).fused
    assert newest_fit(fit_input(path, FIRST + 3, fixes, last), CONFIG) is None


@pytest.mark.parametrize(("row", "delay_s"), [(31, 0.0), (30, DELAY_S)])
def test_a_fix_that_surprises_waits_for_its_verdict(row, delay_s):
    drive = DrivingCamera(400)
    kinds, wrong = fixed_then_float(40, 0, np.zeros(3))
    wrong[row] = [8.0, 5.0, 0.0]
    path, fixes = drive.seen(), drive.fixes(kinds, wrong)
    last = fit(fit_input(path, FIRST, fixes, None, delay_s), CONFIG).fused
    now = fit_input(path, AFTER, fixes, last, delay_s)
    assert newest_fit(now, CONFIG) is None and fit(now, CONFIG).surprising
    trusting = replace(fixes, world_p_fix=fixes.world_p_fix - wrong)
    right = fit_input(path, AFTER, trusting, last, delay_s)
    assert newest_fit(right, CONFIG) is not None and not fit(right, CONFIG).surprising


def test_a_fix_older_than_one_that_was_known_waits_for_a_whole_fit(drive):
    """As that of a second receiver, which the path since the last known fix does not reach."""
    _, path, fixes = drive
    last = fit(fit_input(path, FIRST, fixes), CONFIG).fused
    now = fit_input(path, AFTER, fixes, last)
    assert newest_fit(replace(now, is_new=now.is_new | (now.fixes.t_s == 29.0)), CONFIG) is None


def test_many_wrong_fixes_in_a_short_time_do_not_outvote_the_good_ones_before():
    drive = DrivingCamera(400)
    wrong = np.arange(400) >= 300
    off_m = np.where(wrong[:, None], [2.0, -2.0, 1.0], 0.0)
    fixes = drive.fixes([FixClass.RTK_FIX] * 400, off_m, every=1)
    path = drive.seen(np.random.default_rng(4), share=0.5)
    last = fit(fit_input(path, FIRST, fixes), CONFIG).fused
    rejected = fit_with_verdicts(fit_input(path, 400, fixes, last), CONFIG).assessment.rejected
    assert rejected[wrong].all()
    assert rejected[~wrong].sum() <= 4  # those between the last good and the first wrong one that were judged
