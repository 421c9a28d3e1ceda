"""The HTML page of a run."""

import base64
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from solutions import on_a_rig

from vgps.cli.report import report
from vgps.report import write_report
from vgps.report.page import _number
from vgps.solution import FrameState, Landmarks, Observations, SolverReport
from vgps.writers.run_folder import write_run

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Balanced(HTMLParser):
    """Fails on tags that do not close in order."""

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def page_of(solution, tmp_path):
    out = tmp_path / "deeper" / "report.html"
    write_report(solution, out)
    html = out.read_text(encoding="utf-8")
    checker = Balanced()
    checker.feed(html)
    assert checker.open == []
    return html


@pytest.fixture(scope="module")
def html(solution, tmp_path_factory):
    return page_of(solution, tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def rich(solution, tmp_path_factory):
    """A page with what the other has not, and no warnings; its tables have one row at most."""
    width, height = solution.camera.width, solution.camera.height
    run = replace(
        on_a_rig(solution),
        warnings=(),
        gps=replace(solution.gps, skipped=()),
        sensors=replace(
            solution.sensors,
            fix_errors={"rtk_float": {"noise_m": 0.0114, "walk_m": 0.0641}},
            clock_rate=0.0097,
            clock_rate_sigma=0.0015,
        ),
        static_regions=np.array([[0, 1, 0, 0, width // 2, height]]),
        moving_regions=np.array([[0, 2, 0, 0, width, height]]),
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("vgps.report.page._MAX_ROWS", 1)
        return page_of(run, tmp_path_factory.mktemp("rich"))


def pictures(html):
    return [base64.b64decode(one).decode() for one in re.findall(r"svg\+xml;base64,([^\"]+)", html)]


@pytest.mark.slow
def test_the_page_stands_alone_and_its_pictures_parse(html):
    assert not re.search(r"(src|href)=\"(?!data:)", html) and "<script" not in html
    assert [ET.fromstring(one).tag for one in pictures(html)] == ["{http://www.w3.org/2000/svg}svg"] * 2


@pytest.mark.slow
def test_warnings_come_first_and_in_full(html, rich):
    assert "the clock lags &amp; so on" in html and "gps.nmea: 2 damaged lines skipped" in html
    assert html.index("the clock lags") < html.index('class="tiles"') < html.index(">Path<")
    assert "gave no warnings" not in html and "gave no warnings" in rich


@pytest.mark.slow
def test_verdicts_reasons_and_outages_are_shown(html):
    assert "&lt;b&gt;far&lt;/b&gt; &amp; wrong" in html  # texts of a run are never markup
    assert html.count(">because</td>") == 1
    assert "<td>200</td><td>10.0</td><td>0.875</td>" in re.sub(r"\s*\n\s*", "", html)
    assert "no fix was used from 18.9 to 39.9 s" in html


@pytest.mark.slow
def test_cost_timings_sensors_and_configuration(html):
    assert "12 iterations; converged." in html and "<td>1,050</td><td>105</td>" in html
    assert "A: tracking" in html and "20.0 s" in html and "width: 66.7%" in html
    assert "0.125 s, standard deviation 0.014 s" in html
    assert "0.000, -1.000, 0.500 m, standard deviations 0.010, 0.020, 0.030 m" in html
    assert "<details>" in html and "model: cylinder" in html


@pytest.mark.slow
def test_errors_that_the_log_showed_are_stated(html, rich):
    assert "as this log shows them" not in html
    assert "errors of rtk_float as this log shows them" in rich and "0.011 m" in rich and "0.064 m" in rich


@pytest.mark.slow
def test_a_clock_of_another_rate_is_stated(html, rich):
    assert "in each second" not in html
    assert "more by 9.70 ms in each second, standard deviation 1.50 ms" in rich


@pytest.mark.slow
def test_the_same_run_gives_the_same_page(html, solution, tmp_path):
    assert page_of(solution, tmp_path) == html


@pytest.mark.slow
def test_a_run_without_gps(solution, tmp_path):
    alone = replace(solution, gps=None, fixes=None, georeferenced=False, world_origin=None)
    html = page_of(alone, tmp_path)
    assert (
        "no GPS log" in html
        and "arbitrary" in html
        and "Verdicts" not in html
        and "horizontal / r" not in html
    )
    assert all("nan" not in one.lower() for one in pictures(html))


@pytest.mark.slow
def test_a_run_without_landmarks_sigmas_or_seconds(solution, tmp_path):
    nothing = np.zeros(0, dtype=np.int64)
    bare = replace(
        solution,
        landmarks=Landmarks(np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.uint8)),
        observations=Observations(nothing, nothing, np.zeros((0, 2))),
        sigma_position_m=np.full((len(solution.t_s), 3), np.nan),
        sigma_rotation_rad=np.full((len(solution.t_s), 3), np.nan),
        seconds={},
        config={},
    )
    html = page_of(bare, tmp_path)
    assert "standard deviation</dt>" not in html and ">unknown<" in pictures(html)[1]


@pytest.mark.slow
def test_a_single_frame_without_stage_d_and_with_a_log_without_verdicts(solution, tmp_path):
    one = replace(
        solution,
        t_s=solution.t_s[:1],
        world_T_camera=solution.world_T_camera[:1],
        sigma_position_m=solution.sigma_position_m[:1],
        sigma_rotation_rad=solution.sigma_rotation_rad[:1],
        state=(FrameState.BRIDGED,),
        observations=Observations(np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros((1, 2))),
        fixes=None,
        report=SolverReport({}, {}, 0, ""),
    )
    html = page_of(one, tmp_path)
    assert "1 of them bridged" in html
    assert "stage D" not in html and "Computing time" in html  # no table of costs


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (float("nan"), "–"),
        (0.0966, "0.0966"),
        (12.345, "12.3"),
        (-0.5, "-0.500"),
        (12345.6, "12,346"),
    ],
)
def test_numbers_have_three_figures(value, text):
    assert _number(value) == text


@pytest.mark.slow
def test_the_verb_writes_the_page_of_a_run_folder(solution, tmp_path, capsys):
    write_run(solution, tmp_path / "run")
    report(tmp_path / "run", out=tmp_path / "r.html")
    assert "spring" in (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "wrote" in capsys.readouterr().out


@pytest.mark.slow
def test_a_long_table_of_fixes_refers_to_gps_csv(html, rich):
    assert "see gps.csv" not in html
    assert "And 1 more, see gps.csv" in rich and ">because</td>" not in rich


@pytest.mark.slow
def test_the_cameras_of_a_rig_are_named_and_their_landmarks_counted(solution, rich):
    assert "poses of the first; with rear" in rich
    assert f"{2 * len(solution.observations.frame):,} observations" in rich


@pytest.mark.slow
def test_what_was_left_out_of_the_pictures_is_stated(html, rich):
    assert "bonnet, text, reflection" not in html and "moving objects" not in html
    assert "up to 50.0 %" in rich and "never moves and was left out, in 2 frames" in rich
    assert "up to 100.0 %" in rich and "moves on its own, left out in 3 frames" in rich
