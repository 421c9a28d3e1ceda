import numpy as np
import pytest
from csv_logs import csv_log

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.survey import read_errors

FIX, FLOAT = FixClass.RTK_FIX, FixClass.RTK_FLOAT
DRIVE = np.arange(4)[:, None] * [1.0, 0.5, 0.0]


def test_errors_of_a_receiver_that_stands_are_about_its_rtk_fixes(tmp_path):
    error = np.array([[0.01, 0, 0], [-0.01, 0, 0], [2.0, -1.0, 4.0], [0, 0, 0]])
    found = read_errors(csv_log(tmp_path / "a.csv", error, (FIX, FIX, FLOAT, FIX)))
    np.testing.assert_allclose(found.error_m, error, atol=1e-3)
    assert found.of_class(FLOAT).fix_class == (FLOAT,)
    np.testing.assert_allclose(found.of_class(FLOAT).t_s - found.t_s[0], 2.0)


def test_errors_of_a_receiver_that_moves_are_about_its_reference(tmp_path):
    error = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [0.07, 0.08, 0.09], [-1.0, -2.0, -3.0]])
    log = csv_log(tmp_path / "a.csv", DRIVE + error, (FLOAT, FLOAT, FIX, FLOAT))
    better = csv_log(tmp_path / "b.csv", DRIVE[:3], (FIX, FLOAT, FIX))
    found = read_errors(log, better)
    np.testing.assert_allclose(found.error_m, error[[0, 2]], atol=1e-3)
    assert found.fix_class == (FLOAT, FIX) and found.source == log


def test_only_epochs_at_the_same_time_count(tmp_path):
    log = csv_log(tmp_path / "a.csv", DRIVE + 0.2, [FLOAT] * 4, t_s=[-1.0, 1.009, 2.02, 3.0])
    found = read_errors(log, csv_log(tmp_path / "b.csv", DRIVE, [FIX] * 4))
    np.testing.assert_allclose(found.t_s, [1.009, 3.0])
    alone = csv_log(tmp_path / "c.csv", DRIVE[3:], [FIX], t_s=[3.0])
    np.testing.assert_allclose(read_errors(log, alone).t_s, [3.0])


@pytest.mark.parametrize(
    ("offset_m", "t_s", "reference_class", "message"),
    [
        (0.1, 3e5, FIX, r"a\.csv: no fix at the time of an RTK-fix of the reference; expected .*b\.csv"),
        (0.1, 0.0, FLOAT, r"b\.csv: no RTK-fix epoch in the reference"),
        (0.0, 0.0, FIX, r"a\.csv: the same as the reference .*b\.csv at 4 common epochs"),
        (9.0, 0.0, FIX, r"a\.csv: half of its RTK-fixes are more than 15\.6 m from .*expected at most 1 m"),
    ],
)
def test_a_reference_that_is_none_is_refused(tmp_path, offset_m, t_s, reference_class, message):
    log = csv_log(tmp_path / "a.csv", DRIVE + offset_m, [FIX] * 4)
    better = csv_log(tmp_path / "b.csv", DRIVE, [reference_class] * 4, t_s=t_s + np.arange(4.0))
    with pytest.raises(GpsLogError, match=message):
        read_errors(log, better)


@pytest.mark.slow
def test_a_drive_s_errors_are_those_against_its_reference(data_dir):
    found = read_errors(data_dir / "rtk_drive/solution.pos", data_dir / "rtk_drive/reference.pos")
    assert len(found.of_class(FIX).t_s) == 1649 and len(found.of_class(FLOAT).t_s) == 2800
    spread = np.sqrt(np.mean(found.of_class(FLOAT).error_m ** 2, axis=0))
    np.testing.assert_allclose(spread, [0.133, 0.190, 0.422], atol=2e-3)
