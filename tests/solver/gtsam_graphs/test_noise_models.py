import gtsam
import numpy as np
import pytest
from gtsam import noiseModel
from gtsam.noiseModel import mEstimator
from hypothesis import given
from hypothesis import strategies as st

from vgps.solver.gtsam_graphs.noise_models import PixelNoise, read_noise_model

PIXEL = noiseModel.Isotropic.Sigma(2, 1.7)
positive = st.floats(1e-3, 1e3)


@pytest.mark.slow
@given(positive, positive)
def test_constants_of_losses_are_recovered(sigma: float, k: float) -> None:
    inner = noiseModel.Isotropic.Sigma(2, sigma)
    for name, loss in (("huber", mEstimator.Huber), ("cauchy", mEstimator.Cauchy)):
        found = read_noise_model(noiseModel.Robust.Create(loss.Create(k), inner))
        assert found is not None and found.loss == name
        assert (found.sigma_px, found.k) == pytest.approx((sigma, k), rel=1e-9)


def test_models_without_a_loss() -> None:
    assert read_noise_model(PIXEL) == PixelNoise(1.7, "none", np.inf)
    assert read_noise_model(noiseModel.Unit.Create(2)) == PixelNoise(1.0, "none", np.inf)
    assert read_noise_model(noiseModel.Diagonal.Sigmas(np.array([3.0, 3.0]))) == PixelNoise(
        3.0, "none", np.inf
    )


OTHERS = {
    "unequal sigmas": noiseModel.Diagonal.Sigmas(np.array([1.0, 2.0])),
    "correlated coordinates": noiseModel.Gaussian.Covariance(np.array([[1.0, 0.5], [0.5, 1.0]])),
    "a hard constraint": noiseModel.Constrained.All(2),
    "three coordinates": noiseModel.Isotropic.Sigma(3, 2.0),
    "another loss": noiseModel.Robust.Create(mEstimator.Tukey.Create(4.0), PIXEL),
    "one weight per coordinate": noiseModel.Robust.Create(
        mEstimator.Huber.Create(1.3, mEstimator.Huber.ReweightScheme.Scalar), PIXEL
    ),
    "a loss around unequal sigmas": noiseModel.Robust.Create(
        mEstimator.Huber.Create(1.3), noiseModel.Diagonal.Sigmas(np.array([1.0, 2.0]))
    ),
}


@pytest.mark.parametrize("model", OTHERS.values(), ids=OTHERS)
def test_model_that_cannot_be_read(model: gtsam.noiseModel.Base) -> None:
    assert read_noise_model(model) is None
