import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geometry import project
from vgps.model import Camera
from vgps.tracking.row_motion import at_middle_rows, row_shifts

CAMERA = Camera(
    model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.0, cy=240.0, readout_s=0.03
)


def turned(t: float) -> np.ndarray:
    """Pose of a camera that turns to the right at 30 degrees a second and moves forward at 2 m/s."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.0, np.radians(30.0) * t, 0.0]).as_matrix()
    pose[2, 3] = 2.0 * t
    return pose


KNOT_S = np.array([-0.04, 0.0])
KNOTS = np.stack([turned(t) for t in KNOT_S])


def test_points_are_shifted_to_their_rows_time() -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-2, 2, 50), rng.uniform(-1.5, 1.5, 50), rng.uniform(4, 9, 50)])
    middle, _ = project(CAMERA.K, turned(0.0), points)
    shift = row_shifts(CAMERA, KNOT_S, KNOTS, turned(0.0), points)
    rows = middle
    for _ in range(5):  # the row in which a point is seen decides when it is seen
        t = CAMERA.readout_s * (rows[:, 1] / 479 - 0.5)
        rows = np.concatenate(
            [project(CAMERA.K, turned(at), point[None])[0] for at, point in zip(t, points, strict=True)]
        )
    np.testing.assert_allclose(shift, rows - middle, atol=0.01)
    assert np.abs(shift).max() > 2.0


def test_unknown_points_and_points_behind_stay() -> None:
    points = np.array([[np.nan, 0.0, 5.0], [0.0, 1.0, -5.0]])
    np.testing.assert_array_equal(row_shifts(CAMERA, KNOT_S, KNOTS, turned(0.0), points), np.zeros((2, 2)))


def test_tracks_are_taken_to_the_middle_rows_times() -> None:
    """Tracks that are cubic in time, observed at their rows' times, lie where they were at the frames'."""
    t_s = np.array([0.0, 0.04, 0.09, 0.12, 0.16])
    rng = np.random.default_rng(0)
    start, *rates = (rng.uniform(-size, size, (20, 2)) for size in (200.0, 200.0, 2e3, 1e4))

    def track(at_s: np.ndarray) -> np.ndarray:
        """Pixels (20, V, 2) at times (20, V)."""
        u = at_s[..., None]
        return (320.0, 240.0) + start[:, None] + sum(rate[:, None] * u**k for k, rate in enumerate(rates, 1))

    row_s = np.tile(t_s, (20, 1))
    for _ in range(30):
        row_s = t_s + 0.03 * (track(row_s)[..., 1] / 479 - 0.5)
    true = track(np.tile(t_s, (20, 1)))
    inside = (np.abs(true[..., 1] - 240) < 239).all(axis=1)
    found = at_middle_rows(CAMERA, t_s, track(row_s))
    np.testing.assert_allclose(found[inside], true[inside], atol=1e-6)
    assert inside.sum() > 5 and np.abs(track(row_s) - true)[inside].max() > 1.0
