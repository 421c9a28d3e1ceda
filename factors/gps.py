"""GPS factors: a penalty between the antenna of a camera pose and a fix.

Poses are ``world_T_camera`` (``gtsam.Pose3``, tangent [rotation; translation]), the world is ENU, and the
antenna is a known point in the camera frame, Eq. (17), Kume 2010. Penalties: :mod:`factors.penalties`.
"""

import gtsam
import numpy as np

from factors.custom import POSE3, VECTOR1, VECTOR3, FloatArray, Linearised, Variable, custom_factor
from factors.penalties import Penalty


def gps_factor(
    pose_key: int, fix_world: FloatArray, camera_p_antenna: FloatArray, penalty: Penalty
) -> gtsam.CustomFactor:
    """A fix taken at the instant of a frame.

    Residual (3,): the penalty's, of the offset ``world_T_camera * camera_p_antenna - fix_world``. Jacobian:
    (3, 6) to the pose.

    Args:
        pose_key: Key of the frame's pose.
        fix_world: (3,) the fix, ENU metres.
        camera_p_antenna: (3,) the antenna in the camera frame, metres.
        penalty: What an offset costs.

    Raises:
        ValueError: The fix or the antenna is not three finite numbers.
    """
    fix, antenna = _point(fix_world, "fix_world"), _point(camera_p_antenna, "camera_p_antenna")

    def error(world_T_camera: gtsam.Pose3) -> Linearised:
        residual, jacobian_pose = _at(world_T_camera, fix, antenna, penalty)
        return residual, [jacobian_pose]

    return custom_factor(penalty.noise_model(), [Variable(pose_key, POSE3)], error)


def gps_factor_between(
    key_a: int,
    key_b: int,
    alpha: float,
    fix_world: FloatArray,
    camera_p_antenna: FloatArray,
    penalty: Penalty,
) -> gtsam.CustomFactor:
    """A fix taken at its own time between two frames, the pose interpolated on SE(3).

    Residual (3,): as :func:`gps_factor`, at ``T(alpha) = T_a Exp(alpha Log(T_a^-1 T_b))``: constant velocity
    in the camera's own axes, and exactly T_a at 0 and T_b at 1. Jacobians: (3, 6) to T_a and to T_b. The
    rotation between the frames must stay clear of pi, where Log has a jump.

    Args:
        key_a, key_b: Keys of the two frames' poses.
        alpha: ``(t_fix - t_a) / (t_b - t_a)``, from 0 to 1.
        fix_world: (3,) the fix, ENU metres.
        camera_p_antenna: (3,) the antenna in the camera frame, metres.
        penalty: What an offset costs.

    Raises:
        ValueError: alpha is outside 0..1, or the fix or the antenna is not three finite numbers.
    """
    if not 0 <= alpha <= 1:
        raise ValueError(f"alpha is {alpha}, expected 0 to 1: the fix is not between the two frames")
    fix, antenna = _point(fix_world, "fix_world"), _point(camera_p_antenna, "camera_p_antenna")

    def error(world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3) -> Linearised:
        pose_by_a, pose_by_b = np.zeros((6, 6), order="F"), np.zeros((6, 6), order="F")
        world_T_camera = world_T_a.slerp(alpha, world_T_b, pose_by_a, pose_by_b)
        residual, jacobian_pose = _at(world_T_camera, fix, antenna, penalty)
        return residual, [jacobian_pose @ pose_by_a, jacobian_pose @ pose_by_b]

    return custom_factor(penalty.noise_model(), [Variable(key_a, POSE3), Variable(key_b, POSE3)], error)


def gps_factor_calibrating(
    key_a: int,
    key_b: int,
    key_lag: int,
    key_antenna: int,
    times_s: tuple[float, float, float],
    fix_world: FloatArray,
    penalty: Penalty,
) -> gtsam.CustomFactor:
    """A fix whose clock lags by an unknown time, of an antenna whose place on the camera is unknown.

    Residual (3,): as :func:`gps_factor_between`, at ``alpha = (t_fix - lag - t_a) / (t_b - t_a)``, which may
    leave 0..1: the motion between the frames goes on. Jacobians: (3, 6) to T_a and to T_b; (3, 1) to the lag,
    minus the antenna's velocity; (3, 3) to the antenna, the rotation.

    Args:
        key_a, key_b: Keys of the two frames' poses.
        key_lag: Key of a vector (1,), seconds.
        key_antenna: Key of a vector (3,), the antenna in the camera frame, metres.
        times_s: Of the two frames, and of the fix by its own clock.
        fix_world: (3,) the fix, ENU metres.
        penalty: What an offset costs.

    Raises:
        ValueError: The frames are not in order of time, or the fix is not three finite numbers.
    """
    t_a, t_b, t_fix = times_s
    if not t_a < t_b:
        raise ValueError(f"frames at {t_a} and {t_b} s, expected the earlier one first")
    fix = _point(fix_world, "fix_world")

    def error(
        world_T_a: gtsam.Pose3, world_T_b: gtsam.Pose3, lag: FloatArray, antenna: FloatArray
    ) -> Linearised:
        alpha = (t_fix - float(lag[0]) - t_a) / (t_b - t_a)
        pose_by_a, pose_by_b = np.zeros((6, 6), order="F"), np.zeros((6, 6), order="F")
        world_T_camera = world_T_a.slerp(alpha, world_T_b, pose_by_a, pose_by_b)
        residual, jacobian_pose = _at(world_T_camera, fix, antenna, penalty)
        # the pose moves by its own axes' twist Log(T_a^-1 T_b) from a to b
        twist = gtsam.Pose3.Logmap(world_T_a.between(world_T_b))
        by_time_offset = -(jacobian_pose @ twist)[:, None] / (t_b - t_a)
        # a translation of the camera and a shift of the antenna in its axes are the same
        return residual, [
            jacobian_pose @ pose_by_a,
            jacobian_pose @ pose_by_b,
            by_time_offset,
            jacobian_pose[:, 3:],
        ]

    variables = [Variable(key_a, POSE3), Variable(key_b, POSE3), Variable(key_lag, VECTOR1)]
    return custom_factor(penalty.noise_model(), [*variables, Variable(key_antenna, VECTOR3)], error)


def _at(
    world_T_camera: gtsam.Pose3, fix: FloatArray, antenna: FloatArray, penalty: Penalty
) -> tuple[FloatArray, FloatArray]:
    """The penalty's residual (3,) at a pose, and its Jacobian (3, 6)."""
    antenna_by_pose = np.zeros((3, 6), order="F")
    offset = world_T_camera.transformFrom(antenna, antenna_by_pose) - fix
    residual, residual_by_offset = penalty.residual(offset)
    return residual, residual_by_offset @ antenna_by_pose


def _point(point: FloatArray, name: str) -> FloatArray:
    # a copy: the factor must not change when the caller's array does
    copy = np.array(point, dtype=np.float64)
    if copy.shape != (3,) or not np.isfinite(copy).all():
        raise ValueError(f"{name} is {copy.tolist()}, expected three finite numbers in metres")
    return copy
