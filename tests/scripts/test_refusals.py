"""Scripts refuse bad input in one line with exit code 2."""

import importlib
import sys

import numpy as np
import pytest

from vgps.solution import Trajectory

LOG = "t_s,latitude_deg,longitude_deg,height_m,fix_class\n"


@pytest.fixture
def refused(monkeypatch, capsys):
    """Run a script that is to refuse its arguments; return its line on standard error."""

    def run(name, *words):
        monkeypatch.setattr(sys, "argv", [name, *map(str, words)])
        main = importlib.import_module(f"scripts.{name}").main
        with pytest.raises(SystemExit) as stop:
            main()
        out, err = capsys.readouterr()
        assert stop.value.code == 2 and out == "" and err.count("\n") == 1
        return err.strip()

    return run


GONE = {
    "benchmarks.accuracy": ("{gone}", "--logs", "gps.nmea"),
    "benchmarks.growth": ("{gone}", "--one", "10"),
    "benchmarks.imu": ("{gone}", "--logs", "gps.nmea", "--imu", "imu.csv", "--rig", "rig.yaml"),
    "benchmarks.long": ("{gone}", "--one", "5"),
    "benchmarks.loops": ("{gone}",),
    "benchmarks.online": ("{gone}",),
    "benchmarks.receivers.__main__": ("--recordings", "{gone}"),
    "benchmarks.rigs": ("{gone}",),
    "benchmarks.stage_c": ("{gone}", "--logs", "gps.nmea"),
    "benchmarks.sky_view": ("--recording", "{gone}"),
    "benchmarks.tracker": ("{gone}", "--landmarks", "street.vgps"),
    "experiments.fault_matrix.__main__": ("--recording", "{gone}", "--out", "{gone}/out"),
    "experiments.kume_table6.__main__": ("--recording", "{gone}"),
    "experiments.matsuda.table1": ("{gone}", "--landmarks", "street.vgps", "--out", "{gone}/out"),
    "experiments.models": ("{gone}", "--logs", "gps.nmea"),
    "experiments.receiver_priors": ("--data", "{gone}"),
    "experiments.settings": ("{gone}",),
    "experiments.variants": ("{gone}",),
    "tools.fit_gps_errors": ("{gone}/gps.csv",),
    "tools.plot_run": ("{gone}", "--out", "{gone}/run.png"),
    "tools.truth_from_run": ("{gone}", "--run", "run", "--run-truth", "t.tum", "--out", "out.tum"),
}


@pytest.mark.parametrize("name", GONE)
def test_a_recording_or_run_that_is_not_there(refused, tmp_path, name):
    gone = tmp_path / "gone"
    line = refused(name, *(word.format(gone=gone) for word in GONE[name]))
    assert line.startswith(f"{name.removesuffix('.__main__').rpartition('.')[2]}: {gone}")
    assert not gone.exists()


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("gps.n", "--vary gps.n; expected PART.NAME=VALUE,VALUE as in gps.n=1,2,4"),
        ("n=1,2", "--vary n=1,2; expected PART.NAME=VALUE,VALUE as in gps.n=1,2,4"),
        ("gps.m=1", "--vary gps.m=1: Extra inputs are not permitted"),
        ("gps.n=1,none", "--vary gps.n=none: Input should be a valid integer"),
        ("gps.n=[", "--vary gps.n=[: not YAML"),
    ],
)
def test_settings_that_cannot_be_varied(refused, tmp_path, word, told):
    line = refused("experiments.settings", tmp_path, "--vary", "gps.omega=0.1", word)
    assert line.startswith(f"settings: {told}")


@pytest.mark.parametrize("frames", [-1, 0, 1])
def test_a_walk_of_no_length(refused, frames):
    line = refused("experiments.kume_table6.__main__", "--frames", frames)
    assert line == f"kume_table6: --frames is {frames}, expected at least 2; see --help"


def test_errors_of_no_class_that_is_known(refused, tmp_path):
    log = tmp_path / "static.csv"
    rows = [f"{k},49,8,100,{'rtk_fix' if k < 3 else 'unknown'}\n" for k in range(9)]
    log.write_text(LOG + "".join(rows))
    line = refused("tools.fit_gps_errors", log)
    assert line == f"fit_gps_errors: {log}: 3 rtk_fix, 6 unknown epochs; expected 5 epochs of a known class"


def test_a_camera_that_was_turned_is_turned_where_the_drive_has_it():
    from scripts.tools.truth_from_run import truth_from_run

    east, turned = np.tile(np.eye(4), (3, 1, 1)), np.tile(np.eye(4), (2, 1, 1))
    east[:, 0, 3] = (0.0, 2.0, 4.0)
    turned[:, 0, 3], turned[:, :2, :2] = (1.0, 3.0), [[0, -1], [1, 0]]  # by 90 degrees about z
    t_s, north = np.array([0.0, 1.0, 2.0]), np.tile(np.eye(4), (3, 1, 1))
    north[:, :2, :2], north[:, 1, 3] = [[0, -1], [1, 0]], (5.0, 7.0, 9.0)
    found = truth_from_run(Trajectory(t_s[:2] + 0.5, turned), Trajectory(t_s, east), Trajectory(t_s, north))
    np.testing.assert_allclose(found.world_T_camera[:, :3, 3], [[0, 6, 0], [0, 8, 0]], atol=1e-12)
    np.testing.assert_allclose(found.world_T_camera[:, :2, :2], [-np.eye(2)] * 2, atol=1e-12)
