from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.model import FixClass
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.gps_formats.csrs import looks_like_csrs, read_csrs

# from the service's documentation and users' files; blanks between columns are shortened
HEAD = """HDR GRP CANADIAN GEODETIC SURVEY, SURVEYOR GENERAL BRANCH, NATURAL RESOURCES CANADA
NOTE: Estimated positions are at the epoch of data
DIR FRAME STN DAYofYEAR YEAR-MM-DD HR:MN:SS.SS NSV GDOP RMSC(m) RMSP(m) DLAT(m) DLON(m) DHGT(m) CLK(ns) \
TZD(m) SDLAT(95%) SDLON(95%) SDHGT(95%) SDCLK(95%) SDTZD(95%) LATDD LATMN LATSS LONDD LONMN LONSS HGT(m)
"""
ROW = """BWD IGS14 1812  352.161215 2018-12-18 03:52:09.00   5  6.2   0.328  0.0011  -2.5820  35.4766 8.8807 \
1604085.1542  1.3879     1.0353     0.9430     3.1299     6.8905     0.0046 -77 44 7.88354 39 6 55.84620 \
3777.0632
"""


def test_rows_are_fixes(tmp_path: Path):
    file = tmp_path / "walk.pos"
    file.write_text(HEAD + ROW.replace("03:52:09.00", "03:52:10.50") + ROW)
    assert gps_format(file) == "csrs" and len(read_gps_log(file)) == 2
    late, fix = read_csrs(file.read_bytes()).fixes
    # GPS time is 18 s ahead
    assert fix.t_s == datetime(2018, 12, 18, 3, 51, 51, tzinfo=UTC).timestamp() and late.t_s == fix.t_s + 1.5
    assert fix.latitude_deg == pytest.approx(-77 - 44 / 60 - 7.88354 / 3600, abs=1e-9)
    assert fix.longitude_deg == pytest.approx(39 + 6 / 60 + 55.8462 / 3600, abs=1e-9)
    assert (fix.height_m, fix.fix_class, fix.satellites, fix.line) == (3777.0632, FixClass.PPP, 5, 5)
    np.testing.assert_allclose(fix.sigma_m, np.array([0.9430, 1.0353, 3.1299]) / 1.96)


def test_the_backward_solution_is_read_where_there_are_both():
    both = read_csrs((HEAD + ROW.replace("BWD", "FWD") + ROW).encode())
    assert [fix.line for fix in both.fixes] == [5]
    assert len(read_csrs((HEAD + ROW.replace("BWD", "FWD")).encode()).fixes) == 1


def test_degrees_of_minus_zero_and_another_datum():
    raw = read_csrs((HEAD + ROW.replace("-77", " -0").replace("IGS14", "NAD83")).encode())
    assert raw.fixes[0].latitude_deg == pytest.approx(-44 / 60 - 7.88354 / 3600)
    assert raw.doubts[0].startswith("positions are in NAD83")


def test_damaged_rows_are_counted():
    raw = read_csrs((HEAD + ROW + ROW[:170] + "\n" + ROW.replace("2018-12-18", "2018-13-18")).encode())
    assert raw.notes == ["2 damaged or truncated lines skipped, first line 5"] and len(raw.fixes) == 1


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(0, 800), st.text(max_size=12)), max_size=4))
def test_any_damage_is_survived(damage: list[tuple[int, str]]):
    text = HEAD + ROW
    for at, noise in damage:
        text = text[:at] + noise + text[at + len(noise) :]
    data = text.encode(errors="replace")
    if looks_like_csrs(data):
        read_csrs(data)
