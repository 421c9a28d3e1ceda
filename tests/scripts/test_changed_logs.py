"""Logs as users' programs write them."""

from dataclasses import replace

import numpy as np
import pytest
from solutions import make_gps_log

import vgps
from scripts.experiments.changed_logs import cases, changed, interpolated, write_csv
from vgps.model import FixClass, GeodeticPoint
from vgps.readers.gps import read_gps_log

T_S = np.arange(0.25, 20.0)
LOG = make_gps_log(
    T_S,
    (FixClass.RTK_FIX,) * len(T_S),
    latitude_deg=49.0 + 1.2345e-4 * np.sqrt(T_S),
    longitude_deg=8.4 + 1e-4 * np.sin(T_S),
    height_m=100.0 + 0.1234 * T_S,
)


def test_changes_are_of_digits_and_times():
    logs = dict(changed(LOG, np.random.default_rng(0)))
    assert abs(logs["5 decimals of degrees"].latitude_deg - LOG.latitude_deg).max() == pytest.approx(
        5e-6, rel=0.2
    )
    assert abs(logs["stamps up to 0.05 s off"].t_s - T_S).max() == pytest.approx(0.05, rel=0.2)
    assert logs["as it is"] is LOG


def test_a_file_has_what_was_written(tmp_path):
    write_csv(LOG, tmp_path / "gps.csv")
    read = read_gps_log(tmp_path / "gps.csv")
    np.testing.assert_allclose(read.latitude_deg, LOG.latitude_deg, atol=1e-10)
    np.testing.assert_allclose(read.t_s, T_S - T_S[0])
    write_csv(interpolated(LOG, 0.1), tmp_path / "gps.csv")
    assert len(read_gps_log(tmp_path / "gps.csv")) < 1.2 * len(LOG)


def test_every_case_has_a_log_of_its_own(recording):
    whole = vgps.open_recording(recording)
    true = np.tile(np.eye(4), (len(whole.video.times_s), 1, 1))
    true[:, 0, 3] = whole.video.times_s
    named = replace(whole, rig=replace(whole.rig, world_origin=GeodeticPoint(49.0, 8.4, 100.0)))
    counts = {case.change: len(case.recording.gps) for case in cases(named, true)}
    assert len(counts) == 10
    assert counts["made at 50 a second"] > 4 * counts["made at 10 a second, noise of 0.05 m"]
