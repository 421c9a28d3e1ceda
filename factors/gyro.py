"""Factors on the motion between frames."""

import gtsam
import numpy as np

from factors.custom import POSE3, Linearised, Variable, custom_factor


def constant_velocity_factor(
    key_a: int,
    key_b: int,
    key_c: int,
    dt_ab_s: float,
    dt_bc_s: float,
    rotation_density_rad_s1p5: float,
    translation_density_m_s1p5: float,
) -> gtsam.CustomFactor:
    """Three successive frames move at one velocity, up to white noise on the acceleration.

    Residual (6,): ``Log(T_b^-1 T_c)/dt_bc - Log(T_a^-1 T_b)/dt_ab``, the change of mean velocity in the
    camera's own axes, [rad/s; m/s]. Jacobians: (6, 6) to T_a, T_b, T_c. The rotation between two frames must
    stay clear of pi, where Log has a jump.

    Noise: acceleration of density q (its integral over t has sigma ``q sqrt(t)``) enters the change of mean
    velocity with a weight that rises from 0 to 1 over ab and falls to 0 over bc, so that has sigma
    ``q sqrt((dt_ab + dt_bc)/3)``. Successive factors share an interval; their correlation is neglected.

    Args:
        key_a, key_b, key_c: Keys of the three poses, in order of time.
        dt_ab_s, dt_bc_s: Time between them.
        rotation_density_rad_s1p5: Density q of the angular acceleration, rad/s^2/sqrt(Hz).
        translation_density_m_s1p5: Density q of the acceleration, m/s^2/sqrt(Hz).

    Raises:
        ValueError: A time or a density is not positive.
    """
    if not (dt_ab_s > 0 and dt_bc_s > 0 and rotation_density_rad_s1p5 > 0 and translation_density_m_s1p5 > 0):
        raise ValueError(
            f"times {dt_ab_s}, {dt_bc_s} s and densities {rotation_density_rad_s1p5}, "
            f"{translation_density_m_s1p5}: expected positive numbers"
        )
    sigma_per_density = np.sqrt((dt_ab_s + dt_bc_s) / 3)
    densities = np.repeat([rotation_density_rad_s1p5, translation_density_m_s1p5], 3)

    def error(world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3, world_T_c: gtsam.Pose3) -> Linearised:
        ab_by_a, ab_by_b, bc_by_b, bc_by_c = (np.zeros((6, 6), order="F") for _ in range(4))
        ab = world_T_a.logmap(world_T_b, ab_by_a, ab_by_b)
        bc = world_T_b.logmap(world_T_c, bc_by_b, bc_by_c)
        jacobians = [-ab_by_a / dt_ab_s, bc_by_b / dt_bc_s - ab_by_b / dt_ab_s, bc_by_c / dt_bc_s]
        return bc / dt_bc_s - ab / dt_ab_s, jacobians

    noise = gtsam.noiseModel.Diagonal.Sigmas(densities * sigma_per_density)
    variables = [Variable(key, POSE3) for key in (key_a, key_b, key_c)]
    return custom_factor(noise, variables, error)
