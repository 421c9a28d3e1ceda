import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X

from vgps.smoothing.scene.height_ties import CAMERA_HEIGHT, HeightTies

TIES = HeightTies(
    first=np.array([0, 1, 2, 3]),
    last=np.array([1, 2, 3, 4]),
    ratio=np.array([0.2, 0.25, 0.2, 0.25]),
    sigma=np.full(4, 0.02),
    prior_m=np.array([1.5, 0.06]),
)


def test_the_scale_is_as_uncertain_as_the_height_and_all_stretches_together() -> None:
    assert TIES.scale_sigma == pytest.approx(np.hypot(0.06 / 1.5, 0.02 / 2.0))


def test_stretches_of_the_right_length_cost_nothing() -> None:
    values, graph = gtsam.Values(), TIES.graph()
    along = np.cumsum([0.0, *TIES.prior_m[0] / TIES.ratio])
    for frame, x_m in enumerate(along):
        values.insert(X(frame), gtsam.Pose3(gtsam.Rot3(), np.array([x_m, 2.0, 0.0])))
    values.insert(CAMERA_HEIGHT, TIES.shared()[CAMERA_HEIGHT])
    assert graph.error(values) == pytest.approx(0.0, abs=1e-18)
    values.update(CAMERA_HEIGHT, 1.03 * TIES.prior_m[:1])
    one = 0.5 * (np.log(1.03) / 0.02) ** 2
    assert graph.error(values) == pytest.approx(4 * one + 0.5 * (0.03 * 1.5 / 0.06) ** 2, rel=1e-3)


def test_a_run_folder_keeps_them() -> None:
    again = HeightTies.from_arrays(TIES.arrays())
    assert again is not None
    for name, value in vars(TIES).items():
        np.testing.assert_array_equal(getattr(again, name), value)
    assert HeightTies.from_arrays({}) is None
