"""Accurate fixes of a real drive that were logged with few digits, or at the times at which they came."""

import numpy as np
import pytest
from fewer_features import fewer_features

import vgps
from vgps.evaluation import evaluate
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Verdict

pytestmark = pytest.mark.slow


@pytest.fixture
def smoothed(data_dir, tmp_path):
    """Return the solution with kitti07's RTK-fixes written to a CSV, and its mean error."""
    fixes = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea").gps

    def run(decimals, late_s):
        columns = fixes.t_s + late_s, fixes.latitude_deg, fixes.longitude_deg, fixes.height_m
        lines = [
            f"{t_s:.4f},{latitude:.{decimals}f},{longitude:.{decimals}f},{height:.2f},rtk_fix"
            for t_s, latitude, longitude, height in zip(*columns, strict=True)
        ]
        log = tmp_path / "gps.csv"
        log.write_text("\n".join(["t_s,latitude_deg,longitude_deg,height_m,fix_class", *lines]))
        solution = vgps.smooth(vgps.open_recording(data_dir / "kitti07", gps=log), fewer_features(150))
        truth = read_trajectory(data_dir / "kitti07/truth.tum")
        return solution, evaluate(solution, truth).camera_position_m.mean

    return run


def test_fixes_of_five_decimals_are_believed_to_their_last_digits(smoothed):
    """Taken to be as accurate as their class, most contradict each other and were refused."""
    solution, error_m = smoothed(5, np.zeros(16))
    assert set(solution.fixes.verdict) == {Verdict.USED}
    assert error_m < 0.25


@pytest.mark.parametrize(("off_s", "most_m"), [(0.1, 0.05), (0.02, 0.12)])
def test_fixes_stamped_when_they_came_have_even_times_or_are_that_uncertain(smoothed, off_s, most_m):
    """Taken at their stamps, those up to 0.1 s off contradict each other, and most were refused."""
    late_s = np.random.default_rng(0).uniform(-off_s, off_s, 16)
    solution, error_m = smoothed(9, late_s)
    assert error_m < most_m
    assert any("off even times" in warning for warning in solution.warnings)
    assert (solution.gps.logging_sigma_m[:, :2].max() > 0.03) == (off_s == 0.02)
