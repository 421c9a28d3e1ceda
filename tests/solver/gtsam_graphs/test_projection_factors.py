import gtsam
import numpy as np
import pytest
from gtsam.noiseModel import mEstimator
from gtsam.symbol_shorthand import L, X

from vgps.solver.gtsam_graphs.noise_models import PixelNoise
from vgps.solver.gtsam_graphs.projection_factors import readable_projections, split_projections

CAMERA, OTHER = gtsam.Cal3_S2(500.0, 510.0, 0.0, 320.0, 240.0), gtsam.Cal3_S2(450.0, 450.0, 0.0, 300.0, 250.0)
SKEWED = gtsam.Cal3_S2(500.0, 510.0, 2.0, 320.0, 240.0)
PLAIN = gtsam.noiseModel.Isotropic.Sigma(2, 1.5)
HUBER = gtsam.noiseModel.Robust.Create(mEstimator.Huber.Create(1.3), PLAIN)
CAUCHY = gtsam.noiseModel.Robust.Create(mEstimator.Cauchy.Create(2.0), PLAIN)
TUKEY = gtsam.noiseModel.Robust.Create(mEstimator.Tukey.Create(8.0), PLAIN)


def projection(
    pose: int, point: int, noise: gtsam.noiseModel.Base = PLAIN, camera: gtsam.Cal3_S2 = CAMERA
) -> gtsam.GenericProjectionFactorCal3_S2:
    uv = np.array([10.0 * pose, 10.0 * point])
    return gtsam.GenericProjectionFactorCal3_S2(uv, noise, X(pose), L(point), camera, False, False)


def graph_of(*factors: gtsam.NonlinearFactor) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.push_back(factor)
    return graph


def readable(*factors: gtsam.NonlinearFactor) -> list[bool]:
    graph = graph_of(*factors)
    return readable_projections(graph, *split_projections(graph)).tolist()


PRIOR = gtsam.PriorFactorPose3(X(0), gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6))


def test_projections_are_read_and_the_others_listed() -> None:
    graph = graph_of(PRIOR, projection(1, 4, HUBER), projection(2, 5), projection(3, 4, HUBER, OTHER))
    graph.remove(2)
    projections, others = split_projections(graph)
    assert others == [0]
    np.testing.assert_array_equal(projections.factor, [1, 3])
    np.testing.assert_array_equal(projections.pose_key, [X(1), X(3)])
    np.testing.assert_array_equal(projections.point_key, [L(4), L(4)])
    np.testing.assert_array_equal(projections.uv_px, [[10.0, 40.0], [30.0, 40.0]])
    assert projections.noise_models == [PixelNoise(1.5, "huber", pytest.approx(1.3))]
    assert projections.calibrations == [(500.0, 510.0, 0.0, 320.0, 240.0), (450.0, 450.0, 0.0, 300.0, 250.0)]
    np.testing.assert_array_equal(projections.camera, [0, 1])


def test_projection_that_throws_behind_the_camera_is_none_of_them() -> None:
    throwing = gtsam.GenericProjectionFactorCal3_S2(np.zeros(2), PLAIN, X(0), L(0), CAMERA, True, False)
    projections, others = split_projections(graph_of(throwing))
    assert len(projections) == 0 and others == [0]


def test_selected_projections_keep_their_models() -> None:
    projections, _ = split_projections(graph_of(projection(1, 4), projection(2, 5, CAUCHY)))
    last = projections.select(np.array([False, True]))
    assert last.factor.tolist() == [1] and last.noise.tolist() == [1]
    assert last.noise_models[last.noise[0]] == PixelNoise(1.5, "cauchy", pytest.approx(2.0))


def test_most_frequent_loss_is_read_beside_projections_without_one() -> None:
    factors = [projection(0, 0, HUBER), projection(0, 1, HUBER), projection(0, 2, CAUCHY), projection(0, 3)]
    assert readable(*factors) == [True, True, False, True]


def test_loss_that_cannot_be_read() -> None:
    assert readable(projection(0, 0, TUKEY), projection(0, 1, TUKEY), projection(0, 2)) == [
        False,
        False,
        True,
    ]


def test_most_frequent_calibration_without_skew_is_read() -> None:
    factors = [projection(0, i, PLAIN, camera) for i, camera in enumerate((OTHER, CAMERA, CAMERA))]
    assert readable(*factors) == [False, True, True]
    assert readable(projection(0, 0, PLAIN, SKEWED), projection(1, 0, PLAIN, SKEWED)) == [False, False]


def test_landmark_with_another_factor_is_not_read() -> None:
    prior = gtsam.PriorFactorPoint3(L(0), np.zeros(3), gtsam.noiseModel.Unit.Create(3))
    assert readable(projection(0, 0), projection(1, 0), projection(0, 1), prior) == [False, False, True]


def test_landmark_with_an_unreadable_projection_is_not_read() -> None:
    assert readable(projection(0, 0), projection(1, 0, TUKEY), projection(0, 1)) == [False, False, True]


def test_landmark_observed_twice_from_one_pose_is_not_read() -> None:
    assert readable(projection(0, 0), projection(0, 0), projection(1, 0), projection(0, 1)) == [
        False,
        False,
        False,
        True,
    ]
