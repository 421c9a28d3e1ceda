import numpy as np
import pytest
from fewer_features import fewer_features
from synthetic_fixes import fixes_of_size
from walks import ToAndFro

import vgps
from vgps.config import DriftConfig, MotionConfig, SensorsConfig
from vgps.geodesy import to_geodetic
from vgps.gps.fix_errors import region_sigmas
from vgps.model import FixClass
from vgps.online.fusion.pose_sigmas import pose_sigmas
from vgps.online.replay import fixes_of


def test_sigmas_of_a_bridged_frame_grow_by_the_motion_model():
    covariance = np.diag(np.arange(1.0, 8.0) ** 2)
    seen, bridged = (pose_sigmas(covariance, away_s, MotionConfig()) for away_s in (0.0, 1.0))
    np.testing.assert_allclose(seen.position_m, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(seen.rotation_rad, [5.0, 6.0, 7.0])
    # white noise of 2 m/s^2/sqrt(Hz) for a second: 2 / sqrt(3) m
    np.testing.assert_allclose(bridged.position_m**2 - seen.position_m**2, 4.0 / 3.0)


def sigmas_of(region):
    """Standard deviations (3,) of errors that lie within a region."""
    one = np.ones(1)
    (sigma,) = region_sigmas(fixes_of_size(one, np.zeros((1, 3)), region.r_m * one, region.h_m * one))
    return sigma


def walked_with_float_fixes(walk, frames, seed):
    """Errors in sigmas (n, 3) of a walk with RTK-fixes, which share an error, and then RTK-floats that err by
    their region and correlation time."""
    rng, errors = np.random.default_rng(seed), np.zeros(3)
    template, opened = next(fixes_of(walk.opened.gps)), walk.opened
    # aligned tracks of rendered pictures let a camera drift less than real ones do
    drift = DriftConfig(scale_sigma=0.002, rotation_sigma_deg=0.03)
    config = fewer_features(150, drift=drift, sensors=SensorsConfig(estimate_time_offset="no"))
    smoother, ratios = vgps.OnlineSmoother(opened.camera, opened.rig, config), []
    region = config.gps.regions[FixClass.RTK_FLOAT]
    sigma = sigmas_of(region)
    of_fixes = sigmas_of(config.gps.offset_errors(FixClass.RTK_FIX))
    fixed_error = np.random.default_rng(seed + 100).standard_normal(3) * of_fixes
    for index in range(frames):
        t_s, true = index / 15, walk.true[walk.row(index)]
        if index % 15 == 0:
            kept = np.exp(-2.0 / region.correlation_s) if index else 0.0
            errors = kept * errors + np.sqrt(1.0 - kept**2) * rng.standard_normal(3)
            fixed = index < 60
            antenna = true[:3, 3] + true[:3, :3] @ opened.rig.camera_p_antenna
            error = fixed_error if fixed else sigma * errors
            latitude, longitude, height = (
                float(x) for x in to_geodetic(opened.rig.world_origin, antenna + error)
            )
            kind = FixClass.RTK_FIX if fixed else FixClass.RTK_FLOAT
            fix = template._replace(
                t_s=t_s, latitude_deg=latitude, longitude_deg=longitude, height_m=height, fix_class=kind
            )
            smoother.add_fix(fix)
        estimate = smoother.add_frame(t_s, walk.images[walk.row(index)])
        smoother.refine()
        if estimate.posed:
            ratios.append((estimate.global_T_camera[:3, 3] - true[:3, 3]) / estimate.sigma_position_m)
    return np.array(ratios)


@pytest.mark.slow
def test_sigmas_are_of_the_order_of_the_errors(recording):
    walk = ToAndFro(recording)
    nees = np.mean([np.mean(walked_with_float_fixes(walk, 150, seed) ** 2) for seed in (1, 2)])
    assert 0.5 < nees < 1.5  # 1 per axis if they are honest
