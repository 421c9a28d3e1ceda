"""Errors of receivers replayed on true paths, verdicts counted, and cells summed up."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from solutions import NORTH_R_CAMERA, make_gps_log, make_poses, make_solution

from scripts.benchmarks.receivers import __main__ as benchmark
from scripts.benchmarks.receivers.cells import (
    Cell,
    Counts,
    count_verdicts,
    good_and_wrong,
    independent_samples,
    position_errors,
)
from scripts.benchmarks.receivers.summary import summaries, summarise, worse
from scripts.common.drives import Drive, open_drive
from scripts.common.receivers import Series
from scripts.common.replayed_errors import (
    REPLAYED,
    as_it_comes,
    float_between_fixes,
    make_errors,
    read_series,
    replayed,
    stretch,
)
from vgps.errors import RecordingError
from vgps.model import Camera, FixClass, GeodeticPoint, Recording, Rig
from vgps.solution import Trajectory, Verdict
from vgps.survey import ErrorSeries

FIX, FLOAT, SINGLE = FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.SINGLE
CAMERA = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)


@pytest.fixture
def drive():
    """Ten seconds to the north at 5 m/s and 10 Hz; the antenna is a metre above the camera."""
    t_s = np.arange(101) / 10
    poses = make_poses(np.column_stack([0 * t_s, 5 * t_s, 0 * t_s]), NORTH_R_CAMERA)
    rig = Rig(camera_p_antenna=np.array([0.0, -1.0, 0.0]))
    return Drive(
        name="north",
        recording=Recording(path=Path("north"), video=SimpleNamespace(times_s=t_s), camera=CAMERA, rig=rig),
        origin=GeodeticPoint(49.0, 8.0, 100.0),
        truth=Trajectory(t_s, poses),
        start_s=0.0,
        folder=Path("north"),
    )


@pytest.fixture
def series():
    """Forty epochs, 0.5 s apart, of alternating classes; no value occurs twice."""
    rng, unknown = np.random.default_rng(0), np.full(40, np.nan)
    errors = ErrorSeries(
        t_s=100.0 + 0.5 * np.arange(40),
        error_m=rng.normal(size=(40, 3)),
        sigma_m=rng.uniform(0.1, 1.0, (40, 3)),
        fix_class=(FIX, FLOAT) * 20,
        source=Path("series.csv"),
    )
    return Series(
        errors=errors, hdop=np.arange(40.0), satellites=unknown, correction_age_s=unknown, late_s=0.2
    )


def test_the_antenna_is_interpolated_between_frames(drive):
    np.testing.assert_allclose(
        drive.true_antenna(np.array([0.0, 0.25])), [[0, 0, 1], [0, 1.25, 1]], atol=1e-12
    )


def test_a_stretch_is_consecutive_and_turns_back_at_the_end():
    rng = np.random.default_rng(0)
    found = stretch(np.arange(100), 10, rng)
    np.testing.assert_array_equal(np.diff(found), np.ones(9))
    np.testing.assert_array_equal(stretch(np.array([4, 5, 8]), 7, rng), [4, 5, 8, 5, 4, 5, 8])


def test_replayed_errors_are_those_of_the_series(drive, series):
    log = replayed(series, as_it_comes, drive, np.random.default_rng(1))
    first = int(log.hdop[0])  # the epoch's number
    rows = np.arange(first, first + len(log))
    assert len(log) in (19, 20) and 0.2 <= log.t_s[0] <= 0.7
    np.testing.assert_allclose(np.diff(log.t_s), 0.5)
    np.testing.assert_allclose(drive.errors(log, 0.2), series.errors.error_m[rows], atol=1e-6)
    np.testing.assert_array_equal(log.sigma_m, series.errors.sigma_m[rows])
    assert log.fix_class == tuple(series.errors.fix_class[row] for row in rows)
    # at its time stamp a late fix is also behind by 0.2 s at 5 m/s
    behind = drive.errors(log) - series.errors.error_m[rows]
    np.testing.assert_allclose(behind, np.tile([0.0, -1.0, 0.0], (len(log), 1)), atol=1e-5)


def test_a_position_from_before_the_video_has_no_known_error(drive, series):
    log = replayed(series, as_it_comes, drive, np.random.default_rng(1))
    late = drive.errors(log, 1.0)
    np.testing.assert_array_equal(np.isnan(late[:, 0]), log.t_s < 1.0)


def test_another_seed_chooses_other_errors(drive, series):
    def starts(seeds):
        return [replayed(series, as_it_comes, drive, np.random.default_rng(k)).hdop[0] for k in seeds]

    assert len(set(starts(range(8)))) > 3 and starts([3]) == starts([3])


def test_float_lies_between_fixes(series):
    rows = float_between_fixes(series, 20, np.random.default_rng(2))
    classes = [series.errors.fix_class[row] for row in rows]
    assert classes == [FIX] * 3 + [FLOAT] * 14 + [FIX] * 3
    np.testing.assert_array_equal(np.diff(rows[[0, 1, 2, 17, 18, 19]]), [2] * 5)  # one stretch of fixes
    assert (np.abs(np.diff(rows[3:17])) == 2).all()
    assert len(float_between_fixes(series, 3, np.random.default_rng(2))) == 3


EXPECTED = {
    "survey_fix": {FIX},
    "survey_float": {FLOAT},
    "survey_mixed": {FIX, FLOAT},
    "septentrio": {FIX, FLOAT, FixClass.DGPS, SINGLE},
    "ublox": {SINGLE},
    "rtk_drive": {FIX, FLOAT},
    "rtk_drive_mixed": {FIX, FLOAT},
}


@pytest.mark.slow
@pytest.mark.parametrize("source", REPLAYED)
def test_every_source_is_replayed_from_its_log(drive, data_dir, source):
    found = make_errors(source, drive, data_dir, seed=0)
    whole = read_series(source, data_dir)
    classes = set(found.log.fix_class)
    assert classes <= EXPECTED[source] and len(found.log) > 8
    assert found.mixed == (FIX in classes and len(classes) > 1)
    assert found.seen == source.startswith("survey")
    assert np.isfinite(found.log.sigma_m).all() == (source != "ublox")
    apart = drive.errors(found.log, found.late_s)[:, None] - whole.errors.error_m[None]
    assert np.abs(apart).max(axis=2).min(axis=1).max() < 1e-6  # each is an error of the series
    others = (
        make_errors(source, drive, data_dir, 1),
        make_errors(source, replace(drive, name="b"), data_dir, 0),
    )
    assert len({one.log.t_s[0] for one in (found, *others)}) == 3
    np.testing.assert_array_equal(make_errors(source, drive, data_dir, 0).log.height_m, found.log.height_m)


def test_wrong_is_what_the_class_and_the_sigmas_exclude():
    """RTK-fix has 0.07 m and 0.05 m, RTK-float 2.4 m and 6.5 m."""
    error = np.array(
        [
            [0.2, 0.0, 0.1],  # within 3 x 0.07 and 3 x 0.05 m
            [0.22, 0.0, 0.0],  # beyond, and beyond 5 x 0.04 m
            [0.22, 0.0, 0.0],  # beyond, but the receiver says 0.05 m
            [0.0, 0.0, -0.16],  # beyond in height, no sigma
            [5.0, 5.0, 0.0],  # within 7.2 m in the plane: 7.07
            [5.2, 5.2, 0.0],  # 7.35
            [9.0, 9.0, 9.0],  # no region
            [np.nan] * 3,  # no truth
        ]
    )
    sigma = np.array([0.01, 0.04, 0.05, np.nan, 0.5, 0.5, 0.5, 0.01])[:, None] * np.ones(3)
    classes = (FIX, FIX, FIX, FIX, FLOAT, FLOAT, FixClass.UNKNOWN, FIX)
    good, wrong = good_and_wrong(make_gps_log(np.arange(8.0), classes, sigma_m=sigma), error)
    assert np.flatnonzero(good).tolist() == [0, 4]
    assert np.flatnonzero(wrong).tolist() == [1, 3, 5]


@pytest.mark.slow
def test_wrong_fixes_of_a_shipped_log_are_found(data_dir):
    folder = data_dir / "kitti03"
    drive = open_drive("kitti03", data_dir, data_dir)
    listed = json.loads((folder / "gps_outliers_truth.json").read_text())["outlier_rows"]
    for log, expected in (("gps_outliers.nmea", listed), ("gps_late.nmea", []), ("gps_float_b.nmea", [])):
        errors = make_errors(log, drive, data_dir, 0)
        _, wrong = good_and_wrong(errors.log, drive.errors(errors.log, errors.late_s))
        assert np.flatnonzero(wrong).tolist() == expected and errors.seen


def test_logs_of_the_same_drive_beside_a_recording_ship_with_it(data_dir):
    names = open_drive("kitti03:300-600", data_dir, data_dir).shipped()
    assert {"gps_fix.nmea", "kitti03_more/gps_moving.nmea"} <= set(names)


def test_verdicts_are_counted_by_class():
    used, lowered, rejected = Verdict.USED, Verdict.DOWN_CLASSED, Verdict.REJECTED
    verdict = (used, lowered, rejected, used, rejected, used, rejected, lowered, Verdict.NOT_USED)
    classes = (FIX, FIX, FIX, FLOAT, FLOAT, FIX, FIX, FIX, FIX)
    good = np.array([1, 1, 1, 1, 1, 0, 0, 0, 1], bool)
    wrong = np.array([0, 0, 0, 0, 0, 1, 1, 0, 0], bool)
    assert count_verdicts(make_gps_log(np.arange(9.0), classes), verdict, good, wrong) == Counts(
        good_rtk_fix=3, good_rtk_fix_refused=2, good_other=2, good_other_refused=1, wrong=2, wrong_missed=1
    )


def test_errors_have_the_sigmas_of_their_frames():
    t_s = np.arange(4) / 10
    true = make_poses(np.zeros((4, 3)), np.eye(3))
    moved = make_poses(np.arange(12.0).reshape(4, 3), np.eye(3))
    sigma = np.arange(1.0, 13.0).reshape(4, 3)
    run = make_solution(t_s=t_s, world_T_camera=moved, sigma_position_m=sigma)
    error_m, sigma_m = position_errors(run, Trajectory(t_s[1:], true[1:]))
    np.testing.assert_array_equal(error_m, moved[1:, :3, 3])
    np.testing.assert_array_equal(sigma_m, sigma[1:])


def test_independent_samples_are_the_duration_over_the_correlation_time():
    t_s, rng = 0.1 * np.arange(20000), np.random.default_rng(0)
    keep = np.exp(-0.1 / 2.0)  # a correlation time of 2 s
    ratio = rng.normal(size=(len(t_s), 3))
    for k in range(1, len(t_s)):
        ratio[k] = keep * ratio[k - 1] + np.sqrt(1 - keep**2) * ratio[k]
    assert independent_samples(t_s, ratio) == pytest.approx(1000, rel=0.2)
    assert independent_samples(t_s[:50], np.full((50, 3), 2.0)) == pytest.approx(1.0)


def cell(default_m, fixes_m, gaussian_m, **changes):
    made = Cell(
        recording="k",
        source="s",
        seed=0,
        receiver="a",
        seen=False,
        mixed=False,
        duration_s=10.0,
        fixes=10,
        fixes_mean_m=fixes_m,
        fixes_max_m=1.0,
        mean_m={"cylinder": default_m, "gaussian-receiver": gaussian_m},
        max_m={},
    )
    return replace(made, **changes)


def test_cells_are_summed_up():
    cells = [
        cell(0.20, 0.50, 0.40, mixed=True, nees=2.0, samples=1.0),  # 0.5 of the Gaussian
        cell(0.30, 0.20, 0.40, seed=1, nees=0.5, samples=3.0),  # 1.5 of the fixes: worse
        cell(0.04, 0.01, 0.02, mixed=True),  # 4 of the fixes, but below 0.05 m
        cell(0.104, 0.10, 0.10, mixed=True),  # 1.04: as good
    ]
    counts = Counts(good_rtk_fix=400, good_rtk_fix_refused=1, good_other=10, wrong=5, wrong_missed=2)
    cells[2] = replace(cells[2], counts=counts)
    cells[3] = replace(cells[3], counts=replace(counts, good_rtk_fix=100, good_rtk_fix_refused=0))
    assert summarise(cells) == {
        "cells": 4,
        "without_result": 0,
        "worse_share": 0.25,
        "worst_ratio": pytest.approx(1.5),
        "worst_cell": "k s 1",
        "median_ratio_mixed": pytest.approx(1.04),  # of 0.5, 4 and 1.04
        "good_rtk_fix": 500,
        "rtk_fix_refused_per_1000": pytest.approx(2.0),
        "good_other": 20,
        "other_refused_per_1000": 0.0,
        "wrong": 10,
        "wrong_missed": 4,
        "nees": pytest.approx((2.0 + 3 * 0.5) / 4),
        "samples": 4.0,
    }


def test_a_cell_without_a_result_is_worse():
    failed = cell(1.0, 0.5, 0.5, mean_m={}, failed="too few fixes")
    found = summarise([failed])
    assert worse(failed) and found["worse_share"] == 1.0 and found["without_result"] == 1
    assert found["worst_ratio"] is None and found["median_ratio_mixed"] is None and found["nees"] is None
    # without a Gaussian the fixes remain
    assert cell(1.0, 0.5, 0.1, mean_m={"cylinder": 1.0}).ratio == 2.0


def test_receivers_that_were_seen_are_summed_up_apart():
    found = summaries([cell(0.1, 1.0, 1.0), cell(3.0, 1.0, 1.0, receiver="survey", seen=True)])
    assert list(found) == ["all", "not seen", "a", "survey"]
    assert [one["worse_share"] for one in found.values()] == [0.5, 0.0, 0.0, 1.0]
    assert "not seen" not in summaries([cell(3.0, 1.0, 1.0, seen=True)])


@pytest.mark.slow
def test_a_section_is_a_recording_of_its_own(recording, tmp_path):
    whole = open_drive(str(recording), tmp_path, tmp_path)
    part = open_drive(f"{recording}:30-44", tmp_path, tmp_path)
    frames, images = list(part.recording.video.frames()), list(whole.recording.video.frames())
    assert [frame.index for frame in frames] == list(range(15))
    np.testing.assert_allclose([frame.t_s for frame in frames], part.recording.video.times_s, atol=1e-9)
    np.testing.assert_array_equal(frames[3].gray, images[33].gray)
    assert part.start_s == pytest.approx(2.0) and part.duration_s == pytest.approx(14 / 15)
    np.testing.assert_array_equal(part.truth.world_T_camera, whole.truth.world_T_camera[30:45])
    np.testing.assert_allclose(part.truth.t_s, part.recording.video.times_s, atol=1e-6)
    log, all_fixes = (make_errors("gps.nmea", drive, tmp_path, 0) for drive in (part, whole))
    assert 0 < len(log.log) < len(all_fixes.log) and log.receiver == "simulated" and log.seen
    assert np.abs(part.errors(log.log)).max() < 0.1  # RTK-fix


@pytest.mark.parametrize("section", ["5-999", "9-9"])
def test_frames_that_are_not_there_are_refused(recording, tmp_path, section):
    with pytest.raises(RecordingError, match=r"expected of frames 0 to 89"):
        open_drive(f"{recording}:{section}", tmp_path, tmp_path)


def test_a_source_that_is_not_there_is_refused_in_one_line(recording, monkeypatch, capsys):
    words = ["--recordings", str(recording), "--sources", "gps.txt"]
    monkeypatch.setattr(sys, "argv", ["receivers", *words])
    with pytest.raises(SystemExit) as stop:
        benchmark.main()
    out, err = capsys.readouterr()
    assert stop.value.code == 2 and out == "" and err.count("\n") == 1
    assert err.startswith("receivers: --sources: no source gps.txt; expected logs, survey_fix, ")


def test_logs_belong_to_their_recording_and_other_sources_to_all(recording, drive, monkeypatch):
    known = {"north": {"gps_fix.nmea": Path()}, "walk": {"gps.nmea": Path()}}
    monkeypatch.setattr(Drive, "shipped", lambda self: known[self.name])
    found = benchmark.tasks([drive, replace(drive, name="walk")], ["logs", "gps.nmea", "ublox"], 2)
    assert [(task.recording, task.source) for task in found if task.seed == 1] == [
        ("north", "gps_fix.nmea"),
        ("north", "ublox"),
        ("walk", "gps.nmea"),
        ("walk", "gps.nmea"),
        ("walk", "ublox"),
    ]


@pytest.mark.slow
def test_cells_are_run_and_written(brief, tmp_path, monkeypatch, capsys):
    errors = tmp_path / "receiver_errors"
    errors.mkdir()
    rows = [f"{0.2 * k},0.3,{0.1 * (k % 2)},-0.4" for k in range(60)]
    header = "t_s,error_east_m,error_north_m,error_up_m"
    (errors / "comma_ublox.csv").write_text("\n".join([header, *rows]) + "\n")
    file = tmp_path / "found.json"
    words = ["--recordings", f"{brief}:0-29", "--sources", "gps.nmea", "ublox", "--seeds", "1"]
    words += ["--models", "gaussian-receiver"]
    monkeypatch.setattr(sys, "argv", ["receivers", *words, "--data", str(tmp_path), "--json", str(file)])
    benchmark.main()
    out, err = capsys.readouterr()
    assert "cell 2 of 2" in err and "| worst_ratio |" in out
    found = json.loads(file.read_text(encoding="utf-8"))
    good, biased = found["rows"]
    assert good["source"] == "gps.nmea" and good["mean_m"]["cylinder"] < 0.1 and good["failed"] == ""
    by_model = (set(good[name]) for name in ("mean_m", "max_m", "stage_d_s"))
    assert all(keys == {"cylinder", "gaussian-receiver"} for keys in by_model)
    assert good["counts"]["good_rtk_fix"] == good["fixes"] == 4 and good["nees"] > 0
    # 0.5 m, and 0.135 m behind: 0.09 s at 1.5 m/s
    assert biased["fixes_mean_m"] == pytest.approx(0.5, abs=0.14) and not biased["seen"]
    assert list(found["summary"]) == ["all", "not seen", "simulated", "ublox"]
