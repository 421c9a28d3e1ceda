"""Penalties of fixes under each model."""

from dataclasses import replace

import numpy as np
import pytest
from solutions import make_gps_log

from factors import Cylinder, Ellipsoid
from vgps.config import Config, GpsConfig, Region
from vgps.gps.fix_factors import penalty
from vgps.gps.fixes import fixes_in_world
from vgps.gps.outlier_detection import FixAssessment
from vgps.model import FixClass

CLASSES = (FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.SINGLE)
SURVEYED = GpsConfig(
    model="ellipsoid",
    regions={
        FixClass.RTK_FIX: Region(r_m=0.1, h_m=0.2, alpha_m=0.15, beta_m=0.3),
        FixClass.RTK_FLOAT: Region(r_m=2.0, h_m=5.0, alpha_m=3.0, beta_m=6.0),
        FixClass.SINGLE: Region(r_m=6.0, h_m=12.0),
    },
)


def fixes(config, **columns):
    log = make_gps_log(np.arange(3.0), CLASSES, **columns)
    return fixes_in_world(log, np.zeros((3, 3)), config)


def semi_axes(found, row, config=SURVEYED):
    ellipsoid = penalty(found, row, config)
    assert isinstance(ellipsoid, Ellipsoid)
    return ellipsoid.alpha_m, ellipsoid.beta_m


def test_the_ellipsoid_has_the_semi_axes_of_the_survey():
    found = fixes(SURVEYED)
    assert semi_axes(found, 0) == pytest.approx((0.15, 0.3))
    assert semi_axes(found, 1) == pytest.approx((3.0, 6.0))


def test_without_surveyed_semi_axes_the_ellipsoid_has_r_and_h():
    assert semi_axes(fixes(SURVEYED), 2) == (6.0, 12.0)
    config = Config().with_gps("ellipsoid").gps
    found = fixes(config)
    sizes = [(config.regions[name].r_m, config.regions[name].h_m) for name in CLASSES]
    assert [semi_axes(found, row, config) for row in range(3)] == sizes


def test_the_cylinder_keeps_r_and_h():
    assert penalty(fixes(SURVEYED), 0, SURVEYED.model_copy(update={"model": "cylinder"})) == Cylinder(
        0.1, 0.2, SURVEYED.n, SURVEYED.omega
    )


def test_the_ellipsoid_grows_with_its_region():
    found = fixes(SURVEYED, hdop=np.full(3, 2.0 * SURVEYED.quality.good_hdop))
    assert semi_axes(found, 0) == pytest.approx((0.3, 0.6))


def test_a_down_classed_fix_has_the_ellipsoid_of_the_class_below():
    found = fixes(SURVEYED)
    lowered = FixAssessment(nominal=np.array([0.1, 0.9, 0.9]), lower=np.array([0.8, 0.0, 0.0])).applied(found)
    assert semi_axes(lowered, 0) == pytest.approx((3.0, 6.0))
    assert semi_axes(lowered, 1) == pytest.approx((3.0, 6.0))
    assert not found.down_classed.any()
    assert lowered.down_classed.tolist() == [True, False, False]


def test_the_cost_of_an_ellipsoid_follows_its_semi_axes():
    offset = np.array([[0.15, 0.0, 0.0]])
    wide, narrow = fixes(SURVEYED), fixes(SURVEYED)
    narrow = replace(narrow, shape=np.ones((3, 2)))
    # at the wall omega, inside less; with r instead of alpha the same offset is far outside
    assert penalty(wide, 0, SURVEYED).cost(offset)[0] == pytest.approx(SURVEYED.omega)
    assert penalty(narrow, 0, SURVEYED).cost(offset)[0] == pytest.approx(SURVEYED.omega * 1.5**4)


def test_the_receiver_s_covariance_is_that_of_the_gaussian():
    config = GpsConfig(model="gaussian-receiver", min_sigma_m=1e-3)
    sigma = np.array([[0.01, 0.02, 0.04], [0.01, 0.02, np.nan], [0.01, 0.02, 0.04]])
    correlation = np.array([[-0.5, 0.5, 0.0], [-0.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = fixes(config, sigma_m=sigma, correlation=correlation)
    covariance = penalty(found, 0, config).noise_model().covariance()
    np.testing.assert_allclose(covariance[0], [1e-4, -1e-4, 2e-4], atol=1e-12)
    # without a sigma the correlations mean nothing
    assert penalty(found, 1, config).correlation == (0.0, 0.0, 0.0)
    assert penalty(fixes(config, sigma_m=sigma), 0, config).correlation == (0.0, 0.0, 0.0)
