"""The benchmark of the video alone: drift along a path, and the least time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scripts.benchmarks.odometry import figures
from scripts.common.video_alone import drift_of, least_time, scale_of_pieces
from vgps.config import TrackingConfig
from vgps.model import Frame
from vgps.solution import Trajectory


def straight(length_m: int, step_m: np.ndarray | float = 1.0) -> np.ndarray:
    """Return poses (N, 4, 4) a step apart along x."""
    poses = np.tile(np.eye(4), (length_m + 1, 1, 1))
    poses[1:, 0, 3] = np.cumsum(np.broadcast_to(step_m, length_m))
    return poses


def test_the_scale_is_that_of_pieces_of_ten_metres():
    """Half of a straight drive of 100 m has 0.8 of the scale of the rest; an overall scale is kept."""
    found = straight(100, 3.0 * np.where(np.arange(100) < 40, 0.8, 1.0))
    pieces = scale_of_pieces(found[:, :3, 3], straight(100)[:, :3, 3])
    np.testing.assert_array_equal(pieces.ends, np.arange(0, 100, 10))
    np.testing.assert_allclose(pieces.scale, np.where(np.arange(9) < 4, 2.4, 3.0), rtol=1e-9)


def test_an_even_drift_of_scale_and_heading_is_found_per_hundred_metres():
    """Log scale grows by 0.1 and the heading by 2 degrees every 100 m of 300 m."""
    poses = straight(300, np.exp(0.001 * (np.arange(300) + 0.5)))
    poses[:, :3, :3] = Rotation.from_rotvec(
        np.radians(0.02) * np.outer(np.arange(301), [0, 0, 1])
    ).as_matrix()
    drift = drift_of(poses, straight(300), is_metric=False)
    assert drift.scale_drift == pytest.approx(0.1, rel=1e-3)
    assert drift.rotation_drift_deg == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("is_metric", [True, False])
def test_a_wrong_scale_counts_as_an_error_only_where_the_run_has_a_metre(is_metric):
    drift = drift_of(straight(100, 2.0), straight(100), is_metric=is_metric)
    assert drift.sim3_m == pytest.approx(0.0, abs=1e-9) and drift.scale == pytest.approx(2.0)
    # centred, the errors are those of points a metre apart from -50 to 50
    expected = np.sqrt(np.mean(np.arange(-50, 51) ** 2)) if is_metric else 0.0
    assert drift.se3_m == pytest.approx(expected, abs=1e-9)


def test_a_row_has_the_scale_over_time_relative_to_its_median():
    poses = straight(100, 3.0)
    row = figures(drift_of(poses, straight(100), is_metric=False), Trajectory(0.5 * np.arange(101.0), poses))
    np.testing.assert_allclose(row["piece_t_s"], 2.5 + 5.0 * np.arange(9))
    np.testing.assert_allclose(row["piece_scale"], 1.0)


def test_a_path_that_is_too_short_has_no_drift():
    drift = drift_of(straight(15), straight(15), is_metric=False)
    assert np.isnan(drift.scale_drift) and np.isnan(drift.rotation_drift_deg)


class Shifting:
    """A video of noise that moves by a pixel a frame."""

    times_s = np.arange(4) / 10.0

    def frames(self):
        image = np.random.default_rng(0).integers(0, 255, (64, 100), dtype=np.uint8)
        for k, t_s in enumerate(self.times_s):
            yield Frame(k, float(t_s), np.ascontiguousarray(image[:, k : k + 80]))


def test_the_floor_follows_the_corners_of_every_frame():
    elapsed = least_time(Shifting(), TrackingConfig())
    assert elapsed.cpu_s > 0.0 and elapsed.wall_s > 0.0
