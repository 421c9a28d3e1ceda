import numpy as np
import pytest

from vgps.gps.astray_video import astray_note, left_by_the_video
from vgps.model import FixClass
from vgps.solution import FixTable, Verdict

T_S = np.arange(12.0)
OUT = slice(4, 10)  # rows that are refused


def table_of(error_m, verdict=Verdict.REJECTED):
    """Fixes of which those that err are refused."""
    count = len(error_m)
    wrong = np.linalg.norm(error_m, axis=1) > 0.0
    return FixTable(
        world_p_fix=np.zeros((count, 3)),
        residual_m=error_m,
        r_m=np.full(count, 0.07),
        h_m=np.full(count, 0.05),
        probability=np.zeros(count),
        verdict=tuple(verdict if one else Verdict.USED for one in wrong),
        reason=("",) * count,
    )


def growing(step_m=2.0):
    """Errors of fixes that a path leaves for six seconds, as after a zoom, and in the end meets again."""
    error_m = np.zeros((len(T_S), 3))
    error_m[OUT, 0] = step_m * np.arange(1, 7)
    error_m[OUT, 1] = 0.2 * step_m * np.arange(1, 7) ** 1.5
    return error_m


def left(error_m, fix_class=FixClass.RTK_FIX, t_s=T_S, **table):
    return left_by_the_video(table_of(error_m, **table), [fix_class] * len(t_s), t_s).tolist()


@pytest.mark.parametrize("verdict", [Verdict.REJECTED, Verdict.DOWN_CLASSED])
def test_fixes_from_which_a_path_drifts_away_are_left_by_it(verdict):
    assert left(growing(), verdict=verdict) == [4, 5, 6, 7, 8, 9]


def test_a_path_that_comes_back_has_left_them_on_its_way_out():
    error_m = growing()
    error_m[8:10] = [[2.0, 1.0, 0.0], [0.5, 3.0, 0.0]]
    assert left(error_m) == []
    longer = np.repeat(growing(), 2, axis=0)
    longer[8:20] = growing()[4] * np.array([1, 2, 3, 4, 5, 6, 4, 1, 0.5, 0, 0, 0])[:, None]
    assert left(longer, t_s=np.arange(24.0)) == [8, 9, 10, 11, 12, 13]


def test_a_receiver_errs_otherwise():
    stays, zigzag = growing(), growing()
    stays[OUT] = [0.8, -0.3, 0.2]  # wrong integers
    zigzag[OUT, 0] *= [1, -1, 1, -1, 1, -1]  # wrong fixes one by one
    assert left(stays) == left(zigzag) == left(np.zeros((len(T_S), 3))) == []
    jumps = growing(0.3)
    jumps[6:10] += [20.0, 10.0, 0.0]
    assert left(jumps) == left(growing(0.7)) == []  # one new error, and RTK-floats that converge
    assert left(growing()[:, [2, 1, 0]] * [1.0, 0.01, 1.0]) == []  # in height, where floats drift more
    assert left(growing(), FixClass.SINGLE) == []  # as those of a filter in a tunnel
    assert left(growing(), FixClass.RTK_FLOAT, verdict=Verdict.DOWN_CLASSED) == []


def test_four_fixes_in_a_row_or_fixes_far_apart_tell_nothing():
    short = growing()
    short[8:] = 0.0
    assert left(short) == [] and left(growing(), t_s=6.0 * T_S) == []


def test_fixes_of_a_fast_receiver_are_compared_a_second_apart():
    t_s = np.arange(0.0, 11.95, 0.1)
    error_m = np.stack([np.interp(t_s, T_S, axis) for axis in growing().T], axis=1)
    rows = left(error_m, t_s=t_s)
    assert len(rows) >= 5 and np.ptp(np.diff(rows)) == 0 and rows[1] - rows[0] == 10


def test_the_note_names_times_and_distance():
    note = astray_note(np.arange(4, 10), table_of(growing()), T_S)
    assert "between 4.0 and 9.0 s" in note and "13.4 m at most" in note
