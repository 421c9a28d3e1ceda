"""(E) as a factor graph over the last frames: landmarks, gyro with bias, constant velocity of the centre."""

from typing import SupportsFloat, SupportsIndex, SupportsInt

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, X

from factors import (
    bias_walk_factor,
    constant_centre_velocity_factor,
    gyro_factor,
    known_points_factor,
    preintegrate_rates,
)
from vgps.config import LocalizationConfig
from vgps.geometry.angular_rates import GyroIntegral
from vgps.localization.frame_estimator import motion_between
from vgps.localization.pose import LandmarkMatches, PoseEstimate
from vgps.localization.prediction import MotionState
from vgps.model import FloatArray

# changes in rad, m and rad/s beyond which factors are relinearised: smaller ones leave an error of second
# order, some hundredths of a pixel at a focal length of 700 px and 5 m from a landmark
_RELINEARISE = {"x": np.repeat([3e-3, 2e-2], 3), "b": np.full(3, 1e-2)}


class GraphEstimator:
    """A fixed-lag smoother over poses and gyro biases; older ones are marginalised into a Gaussian prior.

    Args:
        K: (3, 3).
        gyro: Integral of the gyro's rates; None without a usable gyro.
        gyro_R_camera: (3, 3).
        config: Settings.
    """

    def __init__(
        self,
        K: FloatArray,
        gyro: GyroIntegral | None,
        gyro_R_camera: FloatArray | None,
        config: LocalizationConfig,
    ) -> None:
        self._K, self._config = K, config
        self._gyro = gyro if gyro_R_camera is not None else None
        self._mount = np.eye(3) if gyro_R_camera is None else gyro_R_camera
        self._motion: MotionState | None = None
        self._frame = 0
        self._reset()

    @property
    def motion(self) -> MotionState | None:
        """See :class:`vgps.localization.tracker.Estimator`."""
        return self._motion

    def add(self, t_s: float, pose: PoseEstimate, matches: LandmarkMatches, *, restart: bool) -> PoseEstimate:
        """See :class:`vgps.localization.tracker.Estimator`."""
        if restart:
            self._reset()
        before = self._motion
        final = self._update(t_s, pose, matches)
        if final.inlier.sum() < max(
            self._config.min_inliers, self._config.min_graph_agreement * len(matches)
        ):
            # the graph has diverged, and its bias with it
            self._motion = before
            self._reset()
            final = self._update(t_s, pose, matches)
        return final

    def revised(self) -> dict[float, FloatArray]:
        """Return the poses (4, 4) of the frames in the lag by time, revised by later observations."""
        return {t_s: self._values.atPose3(X(k)).matrix() for k, t_s in self._frames}

    def _reset(self) -> None:
        params = gtsam.ISAM2Params()
        thresholds = gtsam.ISAM2ThresholdMap()
        for letter, threshold in _RELINEARISE.items():
            thresholds.insert((letter, threshold))
        params.setRelinearizeThreshold(thresholds)
        params.relinearizeSkip = 1
        self._smoother = gtsam.IncrementalFixedLagSmoother(self._config.lag_s, params)
        self._values = gtsam.Values()
        self._frames: list[tuple[int, float]] = []

    def _update(self, t_s: float, pose: PoseEstimate, matches: LandmarkMatches) -> PoseEstimate:
        k = self._frame = self._frame + 1
        graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
        start.insert(X(k), gtsam.Pose3(pose.world_T_camera))
        start.insert(B(k), self._bias())
        graph.add(self._landmark_factor(k, matches))
        self._add_motion_factors(graph, k, t_s)
        stamps: dict[SupportsInt | SupportsIndex, SupportsFloat | SupportsIndex] = {X(k): t_s, B(k): t_s}
        self._smoother.update(graph, start, stamps)
        self._values = self._smoother.calculateEstimate()
        self._frames = [(i, t) for i, t in [*self._frames, (k, t_s)] if self._values.exists(X(i))]
        return self._read(t_s, k, pose, matches)

    def _landmark_factor(self, k: int, matches: LandmarkMatches) -> gtsam.CustomFactor:
        return known_points_factor(
            X(k), matches.world_p_landmark, matches.uv_px, matches.sigma_px, self._K, self._config.huber_px
        )

    def _add_motion_factors(self, graph: gtsam.NonlinearFactorGraph, k: int, t_s: float) -> None:
        """Add the factors between the frames before and frame k."""
        config = self._config
        if not self._frames:
            noise = gtsam.noiseModel.Isotropic.Sigma(3, config.bias_sigma_rad_s)
            graph.add(gtsam.PriorFactorVector(B(k), self._bias(), noise))
            return
        j, t_j = self._frames[-1]
        graph.add(bias_walk_factor((B(j), B(k)), t_s - t_j, config.bias_walk_rad_s1p5))
        rotation = self._gyro_factor(j, k, t_j, t_s)
        if rotation is not None:
            graph.add(rotation)
        if len(self._frames) > 1:
            i, t_i = self._frames[-2]
            density = config.acceleration_density_m_s1p5
            graph.add(constant_centre_velocity_factor((X(i), X(j), X(k)), (t_j - t_i, t_s - t_j), density))

    def _gyro_factor(self, j: int, k: int, t_j: float, t_s: float) -> gtsam.CustomFactor | None:
        if self._gyro is None or not self._gyro.covers(np.array([t_j]), np.array([t_s]))[0]:
            return None
        rates, dts = self._gyro.steps(t_j, t_s)
        rotation = preintegrate_rates(rates, dts, self._bias(), self._config.gyro_density_rad_s0p5)
        return gyro_factor((X(j), X(k)), B(j), rotation, self._mount)

    def _bias(self) -> FloatArray:
        return np.zeros(3) if self._motion is None else self._motion.gyro_bias_rad_s

    def _read(self, t_s: float, k: int, alone: PoseEstimate, matches: LandmarkMatches) -> PoseEstimate:
        """Return the newest pose, and keep the state for the next prediction.

        The covariance is that of the frame alone, an upper bound that costs nothing.
        """
        pose = np.asarray(self._values.atPose3(X(k)).matrix(), np.float64)
        bias = np.asarray(self._values.atVector(B(k)), np.float64)
        last = self._motion  # after a reset, the frame before it
        if len(self._frames) > 1:
            j, t_j = self._frames[-2]
            last = MotionState(t_s=t_j, world_T_camera=self._values.atPose3(X(j)).matrix())
        self._motion = motion_between(last, t_s, pose, bias, self._config.max_velocity_gap_s)
        return PoseEstimate(pose, alone.covariance, matches.inliers(self._K, pose, self._config.ransac_px))
