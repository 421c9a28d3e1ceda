"""Smooth camera motions with exact poses and angular rates at every time."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline, PchipInterpolator

from vgps.model import FloatArray
from vgps.simulate.camera_path import EAST_R_CAMERA
from vgps.simulate.scene import SceneConfig

_GRID_S = 0.005
_KNOT_S = 0.05
_MARGIN_S = 1.0

# Hz, Hz, rms deg: the gyro of a GoPro in the hand of a walker (gopro_walk), mean of its axes, above the steps
_HAND = ((2, 4, 0.144), (4, 6, 0.070), (6, 8, 0.046), (8, 12, 0.031), (12, 16, 0.010), (16, 30, 0.007))
_SINES = 8  # for each of these bands
_HAND_LEVER_M = 0.3  # from what the hand turns about to the camera


@dataclass(frozen=True)
class Motion:
    """Cubic splines over time of east, north, up [m] and yaw, pitch, roll [rad].

    ``world_R_camera = Rz(yaw) E Rx(pitch) Rz(roll)``: yaw is positive from east to north, pitch upwards, roll
    about the viewing axis, and E looks east. The splines are the truth, not samples of it.
    """

    spline: CubicSpline

    def poses(self, t_s: FloatArray) -> FloatArray:
        """Return world_T_camera (N, 4, 4) at (N,) seconds since the first frame."""
        values = self.spline(t_s)
        pose = np.tile(np.eye(4), (len(t_s), 1, 1))
        pose[:, :3, 3] = values[:, :3]
        pose[:, :3, :3] = (
            _about_z(values[:, 3]) @ EAST_R_CAMERA @ _about_x(values[:, 4]) @ _about_z(values[:, 5])
        )
        return pose

    def rates(self, t_s: FloatArray) -> FloatArray:
        """Return the camera's (N, 3) angular rates in its own axes, rad/s, from the splines' derivatives."""
        _, pitch, roll = self.spline(t_s)[:, 3:].T
        yaw_rate, pitch_rate, roll_rate = self.spline(t_s, 1)[:, 3:].T
        zero = np.zeros_like(pitch)
        up = np.stack([zero, -yaw_rate, zero], axis=-1)  # camera y points down
        back = np.swapaxes(_about_x(pitch), 1, 2) @ up[..., None]
        back[:, 0, 0] += pitch_rate
        rate = np.swapaxes(_about_z(roll), 1, 2) @ back
        rate[:, 2, 0] += roll_rate
        return np.asarray(rate[..., 0])


@dataclass(frozen=True)
class MountedMotion:
    """Motion of another camera of the rig, fixed to the first by ``reference_T_camera`` (4, 4)."""

    motion: Motion
    reference_T_camera: FloatArray

    def poses(self, t_s: FloatArray) -> FloatArray:
        """Return world_T_camera (N, 4, 4) at (N,) seconds since the first frame."""
        return np.asarray(self.motion.poses(t_s) @ self.reference_T_camera)


def build_motion(config: SceneConfig, rng: np.random.Generator) -> Motion:
    """Build the scene's motion: its path at its speed, plus bobbing, shaking, looking around and panning.

    A given path is followed as it is.
    """
    if config.path is not None:
        t, values = config.path.extended(_MARGIN_S)
        values[:, 2] += config.eye_m
        return Motion(CubicSpline(t, values))
    t = np.arange(-_MARGIN_S, config.speed[-1][0] + _MARGIN_S, _GRID_S)
    east, north, heading, speed = _travel(config, t)
    step = 2 * np.pi * config.bob_hz * t
    pace = speed / max(v for _, v in config.speed)  # no bobbing or shaking while standing still
    sway = 0.6 * config.bob_m * pace * np.sin(step / 2 + 0.4)
    wobble = np.deg2rad(config.sway_deg) * pace
    slow = np.deg2rad(config.look_deg) * np.stack([_wander(t, rng, 4.0, 12.0) for _ in range(3)])
    quick = np.deg2rad(config.shake_deg) * pace * np.stack([_wander(t, rng, 0.4, 1.2) for _ in range(3)])
    yaw = heading + slow[0] + 0.3 * quick[0] + wobble * np.sin(step / 2) + _spin(t, config)
    pitch = np.deg2rad(config.pitch_deg) + 0.6 * slow[1] + quick[1] + 0.6 * wobble * np.sin(step + 0.9)
    roll = np.deg2rad(config.roll_deg) + 0.4 * slow[2] + quick[2] + wobble * np.sin(step / 2 + 1.7)
    up = config.eye_m + config.bob_m * pace * np.sin(step) + 0.3 * quick[1]
    every = round(_KNOT_S / _GRID_S)
    if config.hand_shake:
        hand = config.hand_shake * pace * np.stack([_hand(t, rng) for _ in range(3)])
        yaw, pitch, roll = yaw + hand[0], pitch + hand[1], roll + hand[2]
        up, sway = up + _HAND_LEVER_M * hand[1], sway + _HAND_LEVER_M * hand[0]
        every = 1  # knots close enough for its frequencies
    east, north = east - sway * np.sin(heading), north + sway * np.cos(heading)
    return Motion(CubicSpline(t[::every], np.stack([east, north, up, yaw, pitch, roll], axis=-1)[::every]))


def center_line(config: SceneConfig, before_m: float, after_m: float) -> FloatArray:
    """Return (N, 4) distance, east, north [m], heading [rad] per metre, straight beyond the path's ends."""
    if config.path is not None:
        return _extended(*_travelled(config.path.streets), before_m, after_m)
    t = np.arange(-_MARGIN_S, config.speed[-1][0] + _GRID_S, _GRID_S)
    east, north, heading, speed = _travel(config, t)
    inside = t >= 0
    return _extended(_integral(speed)[inside], np.stack([east, north, heading])[:, inside], before_m, after_m)


def _extended(distance: FloatArray, line: FloatArray, before_m: float, after_m: float) -> FloatArray:
    """Return (N, 4) per metre from east, north, heading (3, n) at distances (n,) of a path."""
    along = np.arange(-before_m, distance[-1] + after_m)
    beyond = along - np.clip(along, 0.0, distance[-1])
    moving = np.concatenate([[True], np.diff(distance) > 1e-9])
    east, north, heading = (np.interp(along, distance[moving], x[moving]) for x in line)
    return np.stack(
        [along, east + beyond * np.cos(heading), north + beyond * np.sin(heading), heading], axis=-1
    )


def _travelled(path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distances (n,), and east, north, yaw (3, n), of a path (n, 3)."""
    steps = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)]), path.T


def _travel(config: SceneConfig, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return east, north, heading and speed at the grid of times, without bobbing and shaking."""
    knots_t, knots_v = np.array(config.speed).T
    speed = PchipInterpolator(knots_t, knots_v)(np.clip(t, knots_t[0], knots_t[-1]))
    distance = _integral(speed)
    heading = np.zeros_like(t)
    for start, length, angle in config.bends:
        heading += np.deg2rad(angle) * _smooth_step((distance - start) / length)
    return _integral(speed * np.cos(heading)), _integral(speed * np.sin(heading)), heading, speed


def _integral(rate: FloatArray) -> FloatArray:
    """Return the integral over the grid, zero at the time of the first frame."""
    total: FloatArray = np.asarray(cumulative_simpson(rate, dx=_GRID_S, initial=0.0))
    return np.asarray(total - total[round(_MARGIN_S / _GRID_S)])


def _smooth_step(x: FloatArray) -> FloatArray:
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def _wander(t: FloatArray, rng: np.random.Generator, shortest_s: float, longest_s: float) -> FloatArray:
    """Return a smooth quasi-periodic signal with an amplitude of about 1 and periods in the given range."""
    periods = np.geomspace(shortest_s, longest_s, 3) * rng.uniform(0.9, 1.1, 3)
    phases = rng.uniform(0, 2 * np.pi, 3)
    return np.asarray(np.sum(np.sin(2 * np.pi * t[:, None] / periods + phases), axis=1) / 2)


def _hand(t: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the angle [rad] by which a hand shakes about one axis."""
    total = np.zeros_like(t)
    for low, high, rms_deg in _HAND:
        frequency, phase = rng.uniform(low, high, (_SINES, 1)), rng.uniform(0, 2 * np.pi, (_SINES, 1))
        sines = np.sin(2 * np.pi * frequency * t + phase).sum(axis=0)
        total += np.deg2rad(rms_deg) * np.sqrt(2 / _SINES) * sines
    return total


def _spin(t: FloatArray, config: SceneConfig) -> FloatArray:
    begin = config.speed[-1][0] / 4
    rate = np.deg2rad(config.spin_deg_s) * np.sin(2 * np.pi * (t - begin) / config.spin_period_s)
    return _integral(rate * _smooth_step((t - begin) / config.spin_period_s))


def _about_x(angle: FloatArray) -> FloatArray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([one, zero, zero, zero, c, -s, zero, s, c], axis=-1).reshape(-1, 3, 3)


def _about_z(angle: FloatArray) -> FloatArray:
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
