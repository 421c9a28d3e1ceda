"""Velocities and biases of an IMU as states of the problem of stage D."""

from vgps.imu.start import start_states
from vgps.imu.states import ImuStates, bias_key, velocity_key
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.factor_graph import Scene
from vgps.solver.problem import StateVector


def start_imu(scene: Scene, context: SmoothingContext) -> ImuStates | None:
    """Return velocities and biases that fit a scene; None without an IMU, or where it has no samples."""
    if context.imu is None:
        return None
    return start_states(scene.trajectory, scene.unseen, context.imu, context.config.imu)


def imu_state_vectors(imu: ImuStates) -> dict[int, StateVector]:
    """Return velocities and biases as states of a problem, by their keys."""
    states = {}
    for k, frame in enumerate(imu.frame.tolist()):
        states[velocity_key(k)] = StateVector(imu.velocity[k], frame)
        states[bias_key(k)] = StateVector(imu.bias[k], frame, is_bias=True)
    return states
