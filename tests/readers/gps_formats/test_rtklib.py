from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, unix_s
from vgps.readers.gps_formats.rtklib import looks_like_pos, read_pos

NAMES = (
    "latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) "
)


HEADER = "%  {time}          " + NAMES + "age(s)  ratio\n"


REST = "2  11   0.0200   0.0100   0.0300  -0.0464   0.0980  -0.1219   1.50    0.0"


PLACE = (40.097025378, -105.147247371, 1578.8456)


ROW = "2020/12/24 21:28:42.500 40.097025378 -105.147247371 1578.8456 " + REST


UTC_S = unix_s(datetime(2020, 12, 24, 21, 28, 24, 500000, UTC))  # 18 s of leap seconds


def read(text: str):
    return read_pos(text.encode(), Path("a.pos"))


def only(text: str):
    (fix,) = read(text).fixes
    return fix


def assert_place(fix, expected, tolerance_m: float) -> None:
    metres = np.array(pymap3d.geodetic2enu(*fix[1:4], *expected))
    assert np.linalg.norm(metres) < tolerance_m


def test_a_row_is_one_fix_with_sigmas_east_first():
    log = read(HEADER.format(time="GPST") + ROW + "\n")
    (fix,) = log.fixes
    assert log.clock is Clock.UTC
    assert fix.t_s == pytest.approx(UTC_S, abs=1e-6)
    assert fix[1:4] == PLACE
    assert fix.fix_class is FixClass.RTK_FLOAT
    assert fix.sigma_m == (0.01, 0.02, 0.03)
    assert (fix.satellites, fix.correction_age_s, fix.line) == (11, 1.5, 2)
    assert log.notes == []


@pytest.mark.parametrize(
    ("system", "row"),
    [
        ("GPST", ROW),
        ("GPST", ROW.replace("2020/12/24 21:28:42.500", "2137 422922.500")),
        ("UTC", ROW.replace("21:28:42.500", "21:28:24.500")),
        ("UTC", ROW.replace("2020/12/24 21:28:42.500", "2137 422904.500")),
        ("JST", ROW.replace("24 21:28:42.500", "25 06:28:24.500")),
    ],
)
@pytest.mark.parametrize("separator", [" ", ",", "\t", " , ", ";"])
def test_every_time_format_and_separator(system, row, separator):
    date_and_time, rest = row.split()[:2], row.split()[2:]
    # RTKLIB keeps a blank between date and time whatever the separator; week and tow take the separator
    head = separator.join(date_and_time) if "/" not in row else " ".join(date_and_time)
    fix = only(HEADER.format(time=system) + head + separator + separator.join(rest) + "\n")
    assert fix.t_s == pytest.approx(UTC_S, abs=1e-6)
    assert fix[1:4] == PLACE


def test_quality_may_be_written_as_a_float():
    expected = ["rtk_fix", "rtk_float", "sbas", "dgps", "single", "ppp", "unknown"]
    rows = [ROW.replace(" 2  11", f" {q}.0000000 11").replace("42.5", f"4{q}.5") for q in range(8)]
    log = read(HEADER.format(time="GPST") + "\n".join(rows))
    assert [fix.fix_class for fix in log.fixes] == expected
    assert log.notes == ["1 epoch without a fix skipped"]


def test_degrees_minutes_seconds():
    header = "%  UTC   latitude(d'\")   longitude(d'\")  height(m)   Q  ns\n"
    fix = only(header + "2020/12/24 21:28:24.500   40 05 49.29136 -105 08 50.09054 1578.8456 1 9\n")
    assert fix.latitude_deg == pytest.approx(40 + 5 / 60 + 49.29136 / 3600, abs=1e-12)
    assert fix.longitude_deg == pytest.approx(-(105 + 8 / 60 + 50.09054 / 3600), abs=1e-12)
    assert (fix.height_m, fix.fix_class, fix.satellites) == (1578.8456, FixClass.RTK_FIX, 9)
    fix = only(header + "2020/12/24 21:28:24.500   -0 30 00.0 -0 15 00.0 -12.5 1 9\n")
    assert fix[1:4] == (-0.5, -0.25, -12.5)


LARGE = "2  11   0.0200   0.0100   0.0400  {} {} {}   1.50    0.0"


def ecef(covariance):
    """A solution in ECEF at PLACE, of a covariance (3, 3) east, north, up."""
    x, y, z = pymap3d.geodetic2ecef(*PLACE)
    lat, lon = np.radians(PLACE[:2])
    east = np.array([-np.sin(lon), np.cos(lon), 0])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    R = np.stack([east, np.cross(up, east), up])
    C = R.T @ covariance @ R
    entries = [C[0, 0], C[1, 1], C[2, 2], C[0, 1], C[1, 2], C[2, 0]]
    sd = " ".join(f"{np.sign(c) * np.sqrt(abs(c)):.9f}" for c in entries)
    header = (
        "%  GPST   x-ecef(m)  y-ecef(m)  z-ecef(m)  Q  ns  sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) sdzx(m)\n"
    )
    return header + f"2137 422922.500 {x:.4f} {y:.4f} {z:.4f} 1 11 {sd}\n"


def test_ecef_with_its_covariance():
    fix = only(ecef(np.diag([0.01**2, 0.02**2, 0.03**2])))
    assert_place(fix, PLACE, 1e-4)
    np.testing.assert_allclose(fix.sigma_m, [0.01, 0.02, 0.03], atol=1e-6)
    np.testing.assert_allclose(fix.correlation, np.zeros(3), atol=1e-3)


def test_cross_covariances_are_correlations_of_east_north_up():
    # sdn 2 cm, sde 1 cm, sdu 4 cm; covariances -1e-4 (ne), 2e-4 (eu), 0 (un) m^2
    found = only(HEADER.format(time="GPST") + ROW.replace(REST, LARGE.format(-0.01, 0.01414214, 0.0)))
    np.testing.assert_allclose(found.correlation, [-0.5, 0.5, 0.0], atol=1e-6)
    header = "%  GPST  e-baseline(m)  n-baseline(m)  u-baseline(m) Q ns sde sdn sdu sden sdnu sdue\n"
    row = "2137 422922.500 100.0 -200.0 5.0 1 11 0.01 0.02 0.04 -0.01 0.02 0.0\n"
    fix = only("% ref pos   : 40.129954154 -105.233055352  1669.9904\n" + header + row)
    np.testing.assert_allclose(fix.correlation, [-0.5, 0.0, 0.5], atol=1e-6)
    # 1.1 times the product of the sigmas: of no covariance, so none is believed
    absurd = only(HEADER.format(time="GPST") + ROW.replace(REST, LARGE.format(0.0148324, 0.0, 0.0)))
    assert absurd.correlation == (0.0, 0.0, 0.0) and absurd.sigma_m == (0.01, 0.02, 0.04)


@pytest.mark.parametrize("correlation", [(0.3, -0.6, 0.2), (0.0, 0.0, 0.9)])
def test_correlations_of_an_ecef_covariance(correlation):
    en, eu, nu = correlation
    sigma = np.array([0.01, 0.02, 0.03])
    C = sigma[:, None] * np.array([[1, en, eu], [en, 1, nu], [eu, nu, 1]]) * sigma
    fix = only(ecef(C))
    np.testing.assert_allclose(fix.sigma_m, sigma, atol=1e-6)
    np.testing.assert_allclose(fix.correlation, correlation, atol=1e-4)


def test_a_baseline_from_its_base_station():
    header = "%  GPST  e-baseline(m)  n-baseline(m)  u-baseline(m) Q ns sde(m) sdn(m) sdu(m)\n"
    row = "2137 422922.500 100.0 -200.0 5.0 1 11 0.01 0.02 0.03\n"
    fix = only("% ref pos   : 40.129954154 -105.233055352  1669.9904\n" + header + row)
    expected = pymap3d.enu2geodetic(100.0, -200.0, 5.0, 40.129954154, -105.233055352, 1669.9904)
    assert_place(fix, expected, 1e-6)
    assert fix.sigma_m == (0.01, 0.02, 0.03)
    in_minutes = "% ref pos   :  40 07 47.8349544 -105 13 58.9992672 1669.9904\n"
    assert_place(only(in_minutes + header + row), fix[1:4], 1e-4)
    with pytest.raises(GpsLogError, match="of the baselines is unknown; expected a comment line '% ref pos"):
        read(header + row)


def test_damaged_and_truncated_rows_are_counted():
    rows = [ROW, ROW.replace("40.097", "4x.097"), ROW.replace("42.5", "43.5"), ROW[:70]]
    log = read(HEADER.format(time="GPST") + "\n".join(rows))
    assert [fix.line for fix in log.fixes] == [2, 4]
    assert log.notes == ["2 damaged or truncated lines skipped, first line 3"]


@pytest.mark.parametrize(
    ("number", "absurd"),
    [
        ("2020/", "99999999999/"),
        ("2020/", f"{'9' * 400}/"),
        ("/12/24", "/13/24"),
        ("21:28", "25:28"),
        ("21:28", f"{'9' * 400}:28"),
        (":28:", ":78:"),
        (":42.500", ":1e308"),
        (":42.500", ":-1"),
        ("2020/12/24 21:28:42.500", "20000000000 422922.500"),
        ("2020/12/24 21:28:42.500", "2137 1e999"),
        ("40.097025378", "1e308"),
        ("0.0200", "1e200"),
    ],
)
def test_absurd_numbers_are_damage(number, absurd):
    bad = ROW.replace(number, absurd)
    assert bad != ROW
    log = read(HEADER.format(time="GPST") + ROW.replace("42.5", "41.5") + "\n" + bad)
    assert [fix.line for fix in log.fixes] == [2]
    assert log.notes == ["1 damaged or truncated line skipped, first line 3"]


@pytest.mark.parametrize("place", ["1e308 -105 1669", "95 -105 1669", "40 -105 1e30", "nan nan nan"])
def test_a_base_station_off_the_earth_is_refused(place):
    with pytest.raises(GpsLogError, match="base station of the baselines is unknown"):
        read(f"% ref pos : {place}\n%  GPST  e-baseline(m)\n2137 422922.5 100.0 -200.0 5.0 1 11\n")


def test_more_columns_and_fewer_columns():
    assert only(HEADER.format(time="GPST") + ROW + " 0.1 0.2 0.3\n")[1:4] == PLACE
    fix = only("% GPST latitude(deg) longitude(deg) height(m) Q\n" + " ".join(ROW.split()[:6]) + "\n")
    assert fix[1:4] == PLACE
    assert np.isnan([*fix.sigma_m, fix.satellites, fix.correction_age_s]).all()


def test_assumptions_without_a_header_are_noted():
    log = read(ROW + "\n")
    assert log.fixes[0].t_s == pytest.approx(UTC_S, abs=1e-6)
    assert "assumed GPST" in log.notes[0]


def test_ecef_coordinates_without_a_header_are_told_by_their_size():
    x, y, z = pymap3d.geodetic2ecef(*PLACE)
    log = read(f"2020/12/24 21:28:42.500 {x:.4f} {y:.4f} {z:.4f} {REST}\n" * 2)
    assert log.fixes[0][1:4] == pytest.approx(PLACE, abs=1e-3)
    assert log.notes == ["no line of column names: assumed GPST and ECEF coordinates"]


def test_heights_above_the_geoid_are_noted():
    log = read("% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n" + HEADER.format(time="GPST") + ROW)
    assert "heights are above the sea: EGM96's -16.2 m were added" in log.notes[0]


@pytest.mark.slow
@given(
    st.lists(st.tuples(st.integers(0, 900), st.characters(max_codepoint=127)), max_size=6),
    st.integers(0, 1500),
)
def test_no_damage_breaks_the_reader(changes, length):
    text = list(HEADER.format(time="GPST") + "\n".join(ROW.replace("42.5", f"4{i}.5") for i in range(10)))
    for place, character in changes:
        text[place % len(text)] = character
    cut = "".join(text)[:length]
    try:
        log = read(cut)
    except GpsLogError:
        return
    assert len(log.fixes) <= 10 + len(changes)


@given(st.integers(200, 1400))
def test_a_cut_end_never_yields_a_wrong_position(length):
    text = HEADER.format(time="GPST") + "\n".join(ROW.replace("42.5", f"4{i}.5") for i in range(10))
    for fix in read(text[:length]).fixes[1:]:
        assert fix[1:4] == PLACE


@pytest.mark.slow
def test_real_solutions_have_their_epochs_of_each_class(data_dir):
    for file, counts in (
        ("rtk_walk/gnss.pos", (349, 187)),
        ("rtk_drive/reference.pos", (4449, 72)),
        ("rtk_drive/solution.pos", (1649, 2872)),
    ):
        data = (data_dir / file).read_bytes()
        assert looks_like_pos(data)
        classes = [fix.fix_class for fix in read_pos(data, data_dir / file).fixes]
        assert (classes.count(FixClass.RTK_FIX), classes.count(FixClass.RTK_FLOAT)) == counts
        assert len(classes) == sum(counts)


def test_correlations_of_a_real_drive(data_dir):
    # a row of the file by hand: sdn 0.0032, sde 0.0020, sdne 0.0009 ...
    raw = (data_dir / "rtk_drive/reference.pos").read_bytes()
    fixes = read_pos(raw, Path("reference.pos")).fixes
    rows = [line.split() for line in raw.decode().splitlines() if not line.startswith("%")]
    sdn, sde, _, sdne = (float(number) for number in rows[0][7:11])
    assert fixes[0].correlation[0] == pytest.approx(np.sign(sdne) * sdne**2 / (sdn * sde), abs=1e-9)
    assert (np.abs([fix.correlation for fix in fixes]) < 1.0).all()


@pytest.mark.slow
def test_calendar_and_week_time_of_one_drive_agree(data_dir):
    times = [
        [fix.t_s for fix in read_pos((data_dir / "rtk_drive" / name).read_bytes(), Path(name)).fixes]
        for name in ("reference.pos", "solution.pos")
    ]
    np.testing.assert_allclose(times[0], times[1], atol=1e-3)
