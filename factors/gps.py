"""GPS factors: a penalty on the offset of the antenna of a camera from a fix.

Poses are ``world_T_camera`` (``gtsam.Pose3``, tangent [rotation; translation]), the world is ENU, and the
antenna is a point in the camera frame, Eq. (17), Kume 2010. Penalties: :mod:`factors.penalties`.
"""

from math import inf, isfinite

import gtsam
import numpy as np

from factors.custom import POSE3, VECTOR1, VECTOR3, FloatArray, Linearisation, Variable, custom_factor
from factors.penalties import Penalty


def gps_factor(
    pose_key: int, world_p_fix: FloatArray, camera_p_antenna: FloatArray, penalty: Penalty
) -> gtsam.CustomFactor:
    """Return a factor for a fix at the time of a frame.

    Residual (3,): the penalty's residual at ``world_T_camera * camera_p_antenna - world_p_fix``. Jacobian:
    (3, 6) to the pose.

    Args:
        pose_key: Key of the frame's pose.
        world_p_fix: (3,) ENU metres.
        camera_p_antenna: (3,) antenna in the camera frame, metres.
        penalty: Penalty on the offset.

    Raises:
        ValueError: The fix or the antenna is not three finite numbers.
    """
    fix, antenna = _vector(world_p_fix, "world_p_fix"), _vector(camera_p_antenna, "camera_p_antenna")

    def error(world_T_camera: gtsam.Pose3) -> Linearisation:
        residual, by_pose, _ = _residual(world_T_camera, fix, antenna, penalty)
        return residual, [by_pose]

    return custom_factor(penalty.noise_model(), [Variable(pose_key, POSE3)], error)


def gps_factor_interpolated(
    pose_keys: tuple[int, int],
    alpha: float,
    world_p_fix: FloatArray,
    camera_p_antenna: FloatArray,
    penalty: Penalty,
    offset_key: int | None = None,
) -> gtsam.CustomFactor:
    """Return a factor for a fix between two frames, at a pose interpolated on SE(3).

    Residual (3,): as :func:`gps_factor`, at ``T(alpha) = T_a Exp(alpha Log(T_a^-1 T_b))``: constant velocity
    in the camera's own axes, exactly T_a at 0 and T_b at 1. With an offset of the receiver's solution, the
    penalty is on ``antenna + offset - fix``, the noise about the offset. Jacobians: (3, 6) to T_a and to T_b,
    (3, 3) to the offset. The rotation between the frames must stay clear of pi, where Log is discontinuous.

    Args:
        pose_keys: Keys of the poses of frames a and b.
        alpha: ``(t_fix - t_a) / (t_b - t_a)``, from 0 to 1.
        world_p_fix: (3,) ENU metres.
        camera_p_antenna: (3,) antenna in the camera frame, metres.
        penalty: Penalty on the offset of the antenna from the fix.
        offset_key: Key of the offset of the receiver's solution, a vector (3,), ENU metres, if it has one.

    Raises:
        ValueError: alpha is outside 0..1, or the fix or the antenna is not three finite numbers.
    """
    _check_between(alpha)
    fix, antenna = _vector(world_p_fix, "world_p_fix"), _vector(camera_p_antenna, "camera_p_antenna")

    def error(world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3, *offset: FloatArray) -> Linearisation:
        pose_by_a, pose_by_b = np.zeros((6, 6), order="F"), np.zeros((6, 6), order="F")
        world_T_camera = world_T_a.slerp(alpha, world_T_b, pose_by_a, pose_by_b)
        residual, by_pose, by_offset = _residual(world_T_camera, fix - sum(offset), antenna, penalty)
        return residual, [by_pose @ pose_by_a, by_pose @ pose_by_b, *[by_offset] * len(offset)]

    variables = [Variable(key, POSE3) for key in pose_keys] + _offset_variables(offset_key)
    return custom_factor(penalty.noise_model(), variables, error)


def gps_factor_calibrating(
    pose_keys: tuple[int, int],
    sensor_keys: tuple[int, int],
    alpha: float,
    world_p_fix: FloatArray,
    world_v_antenna: FloatArray,
    penalty: Penalty,
    offset_key: int | None = None,
) -> gtsam.CustomFactor:
    """Return a factor for a fix whose time offset and lever arm are estimated with the poses.

    Residual (3,): as :func:`gps_factor_interpolated`, with the antenna where it was by the time offset
    earlier: ``antenna - time_offset * world_v_antenna``. The velocity is given. Were it that of the two
    poses, it would have their noise, and fixes many times a second would agree best where a large time offset
    lets the poses' noise follow that of the fixes.

    Jacobians: (3, 6) to T_a and to T_b; (3, 1) to the time offset, minus the velocity; (3, 3) to the antenna,
    the rotation; (3, 3) to the offset of the solution.

    Args:
        pose_keys: Keys of the poses of frames a and b.
        sensor_keys: Key of the time offset, a vector (1,), seconds beyond the one in alpha; key of the
            antenna, a vector (3,) in the camera frame, metres.
        alpha: ``(t_fix - t_a) / (t_b - t_a)``, from 0 to 1.
        world_p_fix: (3,) ENU metres.
        world_v_antenna: (3,) velocity of the antenna at the fix, m/s.
        penalty: Penalty on the offset of the antenna from the fix.
        offset_key: As in :func:`gps_factor_interpolated`.

    Raises:
        ValueError: alpha is outside 0..1, or the fix or the velocity is not three finite numbers.
    """
    _check_between(alpha)
    fix, velocity = _vector(world_p_fix, "world_p_fix"), _vector(world_v_antenna, "world_v_antenna")

    def error(
        world_T_a: gtsam.Pose3,
        world_T_b: gtsam.Pose3,
        time_offset: FloatArray,
        antenna: FloatArray,
        *offset: FloatArray,
    ) -> Linearisation:
        pose_by_a, pose_by_b = np.zeros((6, 6), order="F"), np.zeros((6, 6), order="F")
        world_T_camera = world_T_a.slerp(alpha, world_T_b, pose_by_a, pose_by_b)
        at = fix - sum(offset) + time_offset[0] * velocity
        residual, by_pose, by_offset = _residual(world_T_camera, at, antenna, penalty)
        by_time_offset = -(by_offset @ velocity)[:, None]
        # a translation in the camera's axes shifts the antenna by as much
        by_antenna = by_pose[:, 3:]
        by_poses = [by_pose @ pose_by_a, by_pose @ pose_by_b]
        return residual, [*by_poses, by_time_offset, by_antenna, *[by_offset] * len(offset)]

    variables = [Variable(key, POSE3) for key in pose_keys]
    variables += [Variable(sensor_keys[0], VECTOR1), Variable(sensor_keys[1], VECTOR3)]
    return custom_factor(penalty.noise_model(), variables + _offset_variables(offset_key), error)


def offset_factor(offset_key: int, penalty: Penalty, weight: float, tail: float = inf) -> gtsam.CustomFactor:
    """Return a factor that bounds the offset of a receiver's solution, as Eq. (16) bounds a fix's error.

    Residual (3,): the penalty's residual at the offset, its cost ``omega Psi`` times ``weight``. Where the
    size of the penalty is itself unknown, as that of Student's t with ``tail`` degrees of freedom, the cost
    is ``weight (tail + 3) / 2 log(1 + 2 omega Psi / tail)``. Jacobian: (3, 3).

    Args:
        offset_key: Key of the offset, a vector (3,), ENU metres.
        penalty: Penalty on the offset, without a loss of its own if there is a tail.
        weight: Share of an independent observation that the offset counts as.
        tail: Degrees of freedom; infinite if the size is known.

    Raises:
        ValueError: The weight or the tail is not positive.
    """
    if not (weight > 0.0 and tail > 0.0):
        raise ValueError(f"weight is {weight} and tail {tail}, expected positive numbers")
    noise, factor = penalty.noise_model(), np.sqrt(weight)
    if isfinite(tail):
        loss = gtsam.noiseModel.mEstimator.Cauchy.Create(np.sqrt(weight * (tail + 3.0)))
        noise, factor = gtsam.noiseModel.Robust.Create(loss, noise), factor * np.sqrt((tail + 3.0) / tail)

    def error(offset: FloatArray) -> Linearisation:
        residual, by_offset = penalty.residual(offset)
        return factor * residual, [factor * by_offset]

    return custom_factor(noise, [Variable(offset_key, VECTOR3)], error)


def _offset_variables(key: int | None) -> list[Variable]:
    return [] if key is None else [Variable(key, VECTOR3)]


def _residual(
    world_T_camera: gtsam.Pose3, fix: FloatArray, antenna: FloatArray, penalty: Penalty
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the penalty's residual (3,) at a pose, and its Jacobians: (3, 6) to the pose, (3, 3) to minus
    the fix."""
    antenna_by_pose = np.zeros((3, 6), order="F")
    offset = world_T_camera.transformFrom(antenna, antenna_by_pose) - fix
    residual, residual_by_offset = penalty.residual(offset)
    return residual, residual_by_offset @ antenna_by_pose, residual_by_offset


def _check_between(alpha: float) -> None:
    if not 0 <= alpha <= 1:
        raise ValueError(f"alpha is {alpha}, expected 0 to 1: the fix is not between the two frames")


def _vector(vector: FloatArray, name: str) -> FloatArray:
    # a copy, so that the factor does not change with the caller's array
    copy = np.array(vector, dtype=np.float64)
    if copy.shape != (3,) or not np.isfinite(copy).all():
        raise ValueError(f"{name} is {copy.tolist()}, expected three finite numbers")
    return copy
