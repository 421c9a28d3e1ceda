from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recordings import BRIEF
from solutions import make_gps_log

import vgps
from scripts.experiments.fault_matrix.faults import FAULTS
from scripts.experiments.fault_matrix.matrix import MODELS, Cell, as_markdown, matrix_picture, run_fault
from vgps.errors import GpsLogError, TrajectoryError
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import Camera, FixClass, GeodeticPoint, Recording, Rig
from vgps.runtime.progress import NoProgress
from vgps.simulate import GpsConfig, simulate

ORIGIN = GeodeticPoint(49.0, 8.0, 100.0)
FAULT = {fault.name: fault for fault in FAULTS}


def good_log(count=80):
    """A fix a second, half of a frame late, on a straight line east; the last two are after the video."""
    t_s = np.arange(float(count)) + 0.05
    places = to_geodetic(ORIGIN, np.column_stack([10.0 * t_s, np.zeros((count, 2))]))
    classes = tuple(FixClass.RTK_FIX if k < 40 else FixClass.RTK_FLOAT for k in range(count))
    latitude, longitude, height = places.T
    return make_gps_log(
        t_s,
        classes,
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        sigma_m=np.full((count, 3), 0.01),
        line=np.arange(count),
    )


@pytest.fixture
def made():
    video = SimpleNamespace(times_s=np.arange(781) / 10.0)
    camera = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    return Recording(
        path=Path("rec"),
        video=video,
        camera=camera,
        rig=Rig(camera_p_antenna=np.array([0.0, -1.0, 0.0]), video_start_utc=None, world_origin=ORIGIN),
        gps=good_log(),
    )


def faulty(made, name, seed=0):
    return FAULT[name].into(made, np.random.default_rng(seed))


def offsets(made, recording):
    def enu(log):
        return to_enu(ORIGIN, log.latitude_deg, log.longitude_deg, log.height_m)

    return enu(recording.gps) - enu(made.gps)


def test_no_fault_changes_nothing(made):
    found = faulty(made, "none")
    assert found.recording is made and not found.wrong.any()


@pytest.mark.parametrize("percent", [10, 20, 30, 40])
def test_outliers_are_as_many_and_as_far_as_said(made, percent):
    found = faulty(made, f"outliers-{percent}")
    moved = offsets(made, found.recording)
    assert found.wrong.sum() == round(0.01 * percent * 78)  # of those within the 78 s of video
    far = np.hypot(*moved[found.wrong, :2].T)
    assert far.min() > 8.0 - 1e-6 and far.max() < 40.0 + 1e-6
    assert not found.wrong[-1] and np.abs(moved[~found.wrong]).max() == 0.0
    again, other = faulty(made, f"outliers-{percent}"), faulty(made, f"outliers-{percent}", seed=1)
    np.testing.assert_array_equal(again.wrong, found.wrong)
    assert (other.wrong != found.wrong).any()


@pytest.mark.parametrize(("name", "first"), [("cluster", 35), ("start", 0)])
def test_a_cluster_agrees_with_itself_and_claims_to_be_fixed(made, name, first):
    found = faulty(made, name)
    rows = np.flatnonzero(found.wrong)
    assert rows.tolist() == list(range(first, first + 8))
    moved = offsets(made, found.recording)[rows]
    np.testing.assert_allclose(moved, moved[:1].repeat(8, axis=0), atol=1e-6)
    assert np.hypot(*moved[0, :2]) == pytest.approx(15.0)
    assert {found.recording.gps.fix_class[row] for row in rows} == {FixClass.RTK_FIX}


@pytest.mark.parametrize("seconds", [10, 30, 60])
def test_an_outage_takes_the_middle_out_of_every_column(made, seconds):
    log = faulty(made, f"outage-{seconds}").recording.gps
    gap = int(np.argmax(np.diff(log.t_s)))
    assert np.diff(log.t_s)[gap] == pytest.approx(seconds + 1.0, abs=1.0)
    assert 0.5 * (log.t_s[gap] + log.t_s[gap + 1]) == pytest.approx(39.0, abs=1.0)
    assert len(log.fix_class) == len(log.sigma_m) == len(log.line) == len(log) == 80 - seconds
    assert list(log.line) == [round(t - 0.05) for t in log.t_s]


def test_an_outage_that_does_not_fit_is_told(made):
    short = replace(made, video=SimpleNamespace(times_s=np.arange(621) / 10.0))
    with pytest.raises(GpsLogError, match="outage of 60 s leaves 1 fix before it"):
        faulty(short, "outage-60")


def test_clock_lever_arm_and_bias(made):
    np.testing.assert_allclose(faulty(made, "late").recording.gps.t_s - made.gps.t_s, 0.5)
    arm = faulty(made, "lever-arm").recording.rig.camera_p_antenna
    assert np.linalg.norm(arm - made.rig.camera_p_antenna) == pytest.approx(0.5 * np.sqrt(2))
    found = faulty(made, "vertical-bias")
    moved = offsets(made, found.recording)
    assert (np.abs(moved[:, 2] - 4.0) < 1e-6).sum() == 39 and np.abs(moved[:, :2]).max() < 1e-6
    # a float may be 4 m too high: only what is labelled RTK-fix is wrong
    assert found.wrong.sum() == (np.abs(moved[:40, 2]) > 1.0).sum() > 0 and not found.wrong[40:].any()


def test_a_float_solution_wanders_slowly_by_what_it_should(made):
    steps, sizes = [], []
    for seed in range(60):
        found = faulty(made, "float-drift", seed)
        moved = offsets(made, found.recording)[np.array(found.recording.gps.fix_class) == FixClass.RTK_FLOAT]
        moved = moved[np.abs(moved).max(axis=1) > 0]
        steps.append(np.mean(moved[1:, 0] * moved[:-1, 0]))
        sizes.append(np.mean(moved**2, axis=0))
    sigma = np.sqrt(np.mean(sizes, axis=0))
    np.testing.assert_allclose(sigma, [0.87, 0.87, 2.5], rtol=0.15)
    assert np.mean(steps) / sigma[0] ** 2 == pytest.approx(np.exp(-1 / 25), abs=0.03)
    assert not found.wrong.any() and len(moved) == 62


def test_a_log_is_needed(made):
    with pytest.raises(GpsLogError, match="no GPS log"):
        faulty(replace(made, gps=None), "cluster")


def cell(mean_m, max_m, wrong=0, caught=0, good=0, rejected=0):
    return Cell(mean_m=mean_m, max_m=max_m, wrong=wrong, caught=caught, good=good, rejected=rejected)


def test_the_table_has_errors_verdicts_and_what_failed():
    good = cell(0.4123, 0.987, 8, 7, 60, 3)
    unjudged = cell(1.0, 2.0)
    row = {method.name: unjudged if method.model == "cauchy" else good for method in MODELS}
    failed = {method.name: replace(unjudged, failed="too few fixes") for method in MODELS}
    text = as_markdown({"cluster": row, "outage-60": failed}, FAULTS)
    assert text.count("0.412 / 0.99; 7 of 8; 5 %") == 4 and text.count("| 1.000 / 2.00 |") == 1
    assert text.count("no result") == 5 and "- outage-60: too few fixes" in text
    assert "8 fixes in a row off by the same 15 m" in text


def test_the_picture_has_a_dot_for_each_model_and_fault():
    rows = {name: {m.name: cell(0.1, 0.2, good=9, rejected=1) for m in MODELS} for name in ("none", "late")}
    error, rejected = matrix_picture(rows).axes
    assert rejected.get_xlim()[1] >= 10.0  # or no dot at zero would say that it is little
    assert [len(line.get_xdata()) for line in error.lines] == [2] * len(MODELS)
    assert [tick.get_text() for tick in error.get_yticklabels()] == ["none", "late"]
    np.testing.assert_allclose(rejected.lines[0].get_xdata(), 100 / 9)


@pytest.mark.slow
def test_a_fault_on_a_recording_is_run_under_every_model(tmp_path):
    scene = replace(BRIEF, fps=10, gps=GpsConfig(interval_s=0.2, fix_share=0.5))
    simulate(tmp_path / "walk", scene, seed=3)
    config = vgps.Config.model_validate({"intrinsics": {"refine": "no"}})
    recording, truth = vgps.open_recording(tmp_path / "walk"), tmp_path / "walk" / "truth.tum"
    row = run_fault(FAULT["outliers-20"], recording, truth, config, NoProgress())
    assert list(row) == [method.name for method in MODELS]
    assert all(cell.mean_m < 0.1 for cell in row.values())
    assert [(cell.caught, cell.wrong, cell.rejected) for cell in row.values()][:4] == [(3, 3, 0)] * 4
    long = run_fault(FAULT["outage-30"], recording, truth, vgps.Config(), NoProgress())
    assert all("outage of 30 s" in cell.failed for cell in long.values())
    with pytest.raises(TrajectoryError):
        run_fault(FAULT["none"], recording, tmp_path / "no.tum", vgps.Config(), NoProgress())
