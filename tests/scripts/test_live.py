"""The benchmark of live poses: a row for each log, and its measures by hand."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import vgps
from scripts.benchmarks import live
from scripts.common import live_runs
from vgps.model import FixClass
from vgps.online.run import TimedImage
from vgps.readers.gps_formats.fixes import Fix


@pytest.mark.slow
def test_each_log_has_a_row(brief, tmp_path, monkeypatch, capsys):
    found = tmp_path / "live.json"
    words = [str(brief), "--logs", "gps.nmea", "--json", str(found)]
    monkeypatch.setattr(sys, "argv", ["live", *words])
    live.main()
    (row,) = json.loads(found.read_text(encoding="utf-8"))["rows"]
    assert row["log"] == f"{brief.name} gps" and row["seed"] == 0
    assert 0.0 < row["mean_m"] < row["max_m"] < 0.5 and row["fixes_mean_m"] < 0.1
    assert row["pose_p50_ms"] <= row["pose_p99_ms"] and row["offline_mean_m"] is None
    assert capsys.readouterr().out.splitlines()[-1].startswith(f"| {brief.name} gps | 0 | ")


@pytest.mark.parametrize("realtime", [False, True])
def test_poses_as_from_a_camera_come_at_its_pace_and_wait_for_no_fit(brief, monkeypatch, realtime):
    paces, repeatable, smoother = [], [], live_runs.OnlineSmoother

    def replay(_recording, _stop, *, realtime):
        paces.append(realtime)
        return iter(())

    def made(camera, rig, config, **rest):
        repeatable.append(config.online.repeatable)
        return smoother(camera, rig, config, **rest)

    monkeypatch.setattr(live_runs, "replay", replay)
    monkeypatch.setattr(live_runs, "OnlineSmoother", made)
    run = live_runs.run_live(vgps.open_recording(brief), 0, realtime=realtime)
    assert run.estimates == [] and paces == [realtime] and repeatable == [not realtime]


def recorded(classes):
    gps = SimpleNamespace(t_s=np.arange(len(classes)) + 0.5, fix_class=classes)
    return SimpleNamespace(gps=gps, video=SimpleNamespace(times_s=np.arange(8.0)))


def test_fixes_come_before_the_first_frame_after_their_delay():
    frames = [TimedImage(t_s, np.zeros((1, 1), np.uint8), 0.0) for t_s in (0.0, 0.1, 0.2, 0.3, 0.4)]
    fixes = [Fix(t_s, 0.0, 0.0, 0.0, FixClass.SINGLE, 1) for t_s in (0.05, 0.15)]
    feed = sorted([*frames, *fixes], key=lambda one: one.t_s)
    at_once = [one.t_s for one in live_runs.delayed_fixes(feed, 0.0)]
    assert at_once == [one.t_s for one in feed] == [0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4]
    later = [one.t_s for one in live_runs.delayed_fixes(feed, 0.2)]
    assert later == [0.0, 0.1, 0.2, 0.05, 0.3, 0.15, 0.4]
    assert [one.t_s for one in live_runs.delayed_fixes(feed, 0.3)][-2:] == [0.4, 0.15]


def test_errors_count_from_the_first_certain_pose():
    fix, sigma = FixClass.RTK_FIX, [3.0, 2.0, 0.5, 2.0, 0.2, 0.2, 0.2, 0.09]
    estimates = [
        SimpleNamespace(
            global_T_camera=np.diag([1.0, 1.0, 1.0, 1.0]) + 0.3 * np.eye(4, k=3),
            sigma_position_m=np.full(3, s / np.sqrt(3.0)),
            sigma_rotation_rad=np.array([0.1, 0.2, 0.05]),
        )
        for s in sigma
    ]
    turned = np.tile(np.eye(4), (8, 1, 1))
    turned[:, :3, :3] = Rotation.from_euler("y", -0.2).as_matrix()
    truth = live_runs.Truth(turned, np.full((4, 3), 1.0), np.full(4, 0.05))
    later = [SimpleNamespace(global_T_camera=np.eye(4) + 0.1 * np.eye(4, k=3))] * 8
    found = live_runs.score(recorded([fix] * 4), truth, live_runs.LiveRun(estimates, later, [0.01] * 8))
    assert found["since_s"] == 2.0 and found["mean_m"] == found["max_m"] == pytest.approx(0.3)
    assert found["later_mean_m"] == pytest.approx(0.1)
    assert found["fixes_mean_m"] == pytest.approx(np.sqrt(3.0)) and np.isnan(found["returned"])
    # 0.3 m are more than three sigmas in the last frame only
    assert found["beyond_three_sigmas"] == pytest.approx(1 / 6)
    ratios = 0.3**2 / np.array([0.5, 2.0, 0.2, 0.2, 0.2, 0.09]) ** 2
    assert found["nees"] == pytest.approx(3.0 * ratios.mean())
    assert found["rotation_deg"] == pytest.approx(np.degrees(0.2))
    assert found["rotation_nees"] == pytest.approx(1.0)  # all of it about north


def test_the_return_of_rtk_fixes_is_compared_with_the_stretch_before():
    fix, other = FixClass.RTK_FIX, FixClass.RTK_FLOAT
    log = recorded([fix, other, other, fix, fix, fix])
    t_s, error_m = np.arange(0.0, 7.0, 0.5), np.arange(14.0)
    # before: 1.5 to 3.0 s, after: from 4.5 s on
    assert live_runs.after_return(log, t_s, error_m) == pytest.approx(
        np.mean(range(9, 14)) / np.mean([3, 4, 5, 6])
    )
    assert np.isnan(live_runs.after_return(recorded([fix] * 4), t_s, error_m))
