"""Control and check points as a user has them: from the file of marks to the figures in the report."""

import re
import shutil

import numpy as np
import pytest
from marks import write_marks
from scipy.optimize import least_squares

from vgps.camera import project
from vgps.evaluation.check_points import marks_of
from vgps.readers.run_folder import read_run

pytestmark = pytest.mark.slow


def intersection(solution, rows):
    """The point (3,) nearest to its observations, by SciPy."""
    points, poses = solution.control_points, solution.world_T_camera
    frames, uv = points.frame[rows], points.uv_px[rows]

    def error(point):
        p = np.einsum("fji,fj->fi", poses[frames, :3, :3], point - poses[frames, :3, 3])
        return (project(solution.camera, p) - uv).ravel()

    start = poses[frames[-1], :3, 3] + poses[frames[-1], :3, 2] * 8.0
    return least_squares(error, start).x


def test_ce90_in_the_report_is_that_of_the_truth(recording, tmp_path, vgps_verb):
    walk = tmp_path / "walk"
    shutil.copytree(recording, walk)
    true = write_marks(recording, walk / "control_points.csv", count=40, control=0)
    code, printed, error = vgps_verb("smooth", walk, "--out", tmp_path / "run")
    assert code == 0, error
    assert re.search(r"\d\d of 40 check points: RMSE horizontal", printed)
    code, printed, _ = vgps_verb("report", tmp_path / "run", "--out", tmp_path / "r.html", "--geoid", "egm96")
    stated = [float(x) for x in re.search(r"CE90 ([\d.]+) m, LE90 ([\d.]+) m", printed).groups()]
    run = read_run(tmp_path / "run")
    rows = [np.flatnonzero(np.array(run.control_points.name) == f"M{k}") for k in range(len(true))]
    wide = [mark.angle_deg > 5.0 for mark in marks_of(run)]
    assert 20 < sum(wide) <= 40
    away = np.array([intersection(run, row) for row in rows])[wide] - true[wide]
    computed = np.quantile(np.hypot(away[:, 0], away[:, 1]), 0.9), np.quantile(np.abs(away[:, 2]), 0.9)
    np.testing.assert_allclose(stated, computed, rtol=0.05, atol=0.0006)
    html = (tmp_path / "r.html").read_text()
    assert f"<td>CE90 [m]</td><td>{stated[0]:.3f}</td>" in html
    assert html.count('src="data:image/jpeg') == 40
    assert "height above the geoid EGM96" in html and "EGM96 at the origin" in html


def test_control_points_hold_the_run_as_well_as_they_are_known(brief, tmp_path, vgps_verb):
    """Without GPS, marks known to 1 cm give place and scale; check points say how well."""
    walk = tmp_path / "walk"
    shutil.copytree(brief, walk)
    (walk / "gps.nmea").unlink()
    write_marks(brief, walk / "control_points.csv", count=40, control=20, sigma_m=0.01)
    code, printed, error = vgps_verb("smooth", walk, "--out", tmp_path / "run")
    assert code == 0, error
    horizontal = float(re.search(r"\d+ of 20 check points: RMSE horizontal ([\d.]+)", printed)[1])
    assert horizontal < 0.1


def test_control_points_in_an_unknown_system_are_refused(recording, tmp_path, vgps_verb):
    marks = tmp_path / "marks.csv"
    marks.write_text("frame,u_px,v_px,easting_m,northing_m,height_m\n0,1,2,500000,5400000,5\n")
    words = ["smooth", recording, "--out", tmp_path / "run", "--control-points", marks]
    code, _, error = vgps_verb(*words)
    assert code == 2 and "name it with --control-crs EPSG:NNNN" in error
    code, _, error = vgps_verb(*words, "--control-crs", "EPSG:25832+7837")
    assert code == 2 and error.count("\n") == 1 and "de_bkg_gcg2016.tif" in error
