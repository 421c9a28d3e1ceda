"""Motion factors: three successive frames move at constant velocity, up to white noise on the acceleration.

Acceleration of density q, whose integral over t has sigma ``q sqrt(t)``, enters the change of mean velocity
with a weight that rises from 0 to 1 over ab and falls to 0 over bc, so that this change has sigma
``q sqrt((dt_ab + dt_bc) / 3)``. Successive factors share an interval; their correlation is neglected.
"""

import gtsam
import numpy as np

from factors.custom import POSE3, Linearisation, Variable, custom_factor


def constant_velocity_factor(
    pose_keys: tuple[int, int, int],
    intervals_s: tuple[float, float],
    rotation_density_rad_s1p5: float,
    translation_density_m_s1p5: float,
) -> gtsam.CustomFactor:
    """Return a factor for constant velocity of the pose, in the camera's own axes.

    Residual (6,): ``Log(T_b^-1 T_c)/dt_bc - Log(T_a^-1 T_b)/dt_ab``, the change of mean velocity
    [rad/s; m/s]. Jacobians: (6, 6) to T_a, T_b, T_c. The rotation between two frames must stay clear of pi,
    where Log is discontinuous.

    Args:
        pose_keys: Keys of the poses of frames a, b, c, in order of time.
        intervals_s: dt_ab and dt_bc.
        rotation_density_rad_s1p5: Density of the angular acceleration, rad/s^2/sqrt(Hz).
        translation_density_m_s1p5: Density of the acceleration, m/s^2/sqrt(Hz).

    Raises:
        ValueError: An interval or a density is not positive.
    """
    dt_ab_s, dt_bc_s = intervals_s
    _require_positive(intervals_s, rotation_density_rad_s1p5, translation_density_m_s1p5)
    densities = np.repeat([rotation_density_rad_s1p5, translation_density_m_s1p5], 3)

    def error(world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3, world_T_c: gtsam.Pose3) -> Linearisation:
        ab_by_a, ab_by_b, bc_by_b, bc_by_c = (np.zeros((6, 6), order="F") for _ in range(4))
        ab = world_T_a.logmap(world_T_b, ab_by_a, ab_by_b)
        bc = world_T_b.logmap(world_T_c, bc_by_b, bc_by_c)
        jacobians = [-ab_by_a / dt_ab_s, bc_by_b / dt_bc_s - ab_by_b / dt_ab_s, bc_by_c / dt_bc_s]
        return bc / dt_bc_s - ab / dt_ab_s, jacobians

    noise = gtsam.noiseModel.Diagonal.Sigmas(densities * _sigma_per_density(intervals_s))
    return custom_factor(noise, [Variable(key, POSE3) for key in pose_keys], error)


def constant_centre_velocity_factor(
    pose_keys: tuple[int, int, int], intervals_s: tuple[float, float], density_m_s1p5: float
) -> gtsam.CustomFactor:
    """Return a factor for constant velocity of the camera centre, whatever the rotation.

    Residual (3,): ``(c_c - c_b)/dt_bc - (c_b - c_a)/dt_ab`` [m/s] in world axes, Eq. (5), Matsuda 2007, for
    the centre. Jacobians: (3, 6) to T_a, T_b, T_c, zero to the rotations.

    Args:
        pose_keys: Keys of the poses of frames a, b, c, in order of time.
        intervals_s: dt_ab and dt_bc.
        density_m_s1p5: Density of the acceleration, m/s^2/sqrt(Hz).

    Raises:
        ValueError: An interval or the density is not positive.
    """
    _require_positive(intervals_s, density_m_s1p5)
    by_a, by_c = 1 / intervals_s[0], 1 / intervals_s[1]

    def error(world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3, world_T_c: gtsam.Pose3) -> Linearisation:
        a, b, c = (pose.translation() for pose in (world_T_a, world_T_b, world_T_c))
        jacobians = [
            np.hstack([np.zeros((3, 3)), factor * pose.rotation().matrix()])
            for factor, pose in ((by_a, world_T_a), (-by_a - by_c, world_T_b), (by_c, world_T_c))
        ]
        return (c - b) * by_c - (b - a) * by_a, jacobians

    noise = gtsam.noiseModel.Isotropic.Sigma(3, density_m_s1p5 * _sigma_per_density(intervals_s))
    return custom_factor(noise, [Variable(key, POSE3) for key in pose_keys], error)


def _sigma_per_density(intervals_s: tuple[float, float]) -> float:
    return float(np.sqrt((intervals_s[0] + intervals_s[1]) / 3))


def _require_positive(intervals_s: tuple[float, float], *densities: float) -> None:
    if not (min(intervals_s) > 0 and all(density > 0 for density in densities)):
        raise ValueError(
            f"intervals are {intervals_s} s and densities {densities}, expected positive numbers"
        )
