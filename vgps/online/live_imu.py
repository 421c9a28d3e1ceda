"""The IMU of a live session, and whether it moves as the video does: else it is left out from then on."""

from concurrent.futures import Future
from dataclasses import dataclass, replace

from vgps.config import Config
from vgps.imu.agreement import Agreement, agreement, path_rotations
from vgps.imu.camera_imu import CameraImu, used_imu
from vgps.imu.force_agreement import wrong_forces
from vgps.imu.rotation import RotationPredictor
from vgps.mapping.trajectory import map_trajectory
from vgps.model import ImuLog, ImuMount, Rig
from vgps.online.fusion.live_fusion import LiveFusion
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.runtime.threads import begin
from vgps.solution import Trajectory

_FIRST_S, _LONGEST_S = 4.0, 32.0  # of a path that is compared, at first and at most
_AGAIN_S = 1.0  # after which what was found has to be found again, on a path that is longer by that
_ANSWER_S = 0.5  # after which an answer is used, however quickly it was found: results repeat


@dataclass(frozen=True)
class Comparison:
    """What a path says of an IMU's rotations, and with what instead its specific force would fit."""

    turning: Agreement
    forces: str | None

    @property
    def finding(self) -> str | None:
        """What is wrong; None if nothing is."""
        if self.turning.contradiction is not None:
            return "rotations"
        return "clock" if self.turning.misled else self.forces


class LiveImu:
    """Compares the IMU with the newest map in a thread, over its last 4, 8, 16 and then 32 s.

    A young map may be wrong for a moment, so a finding counts if it is the same a second later. If the IMU
    turns otherwise than the video, it predicts nothing any more, and a new map takes the place of the one
    that it bent. If only its specific force contradicts the path, its rotations still count. In both cases
    the path is fitted to the fixes anew, without gravity. A clock that is off is corrected.

    Args:
        log: On the video's clock; None without an IMU.
        rig: Its mounting.
        config: Settings.

    Attributes:
        log: The log, its clock as corrected; None if it is left out.
        at_camera: The same at the camera's centre.
    """

    def __init__(self, log: ImuLog | None, rig: Rig, config: Config) -> None:
        self.log, self._mount, self._config = log, rig.imu, config
        self.at_camera = used_imu(log, rig.imu, rig.world_origin, config.imu)
        self._comparison: Future[Comparison] | None = None
        self._due_s = 0.0  # of its answer, or of the next one
        self._span_s = _FIRST_S  # of its path
        self._suspected: str | None = None

    def check(self, frame_pipeline: FramePipeline, fusion: LiveFusion) -> None:
        """Begin a comparison or use its answer, if that is due; call it after stages B and C."""
        imu, current = self.at_camera, frame_pipeline.current
        now_s = float(frame_pipeline.t_s[-1])
        if imu is None or self._mount is None or current is None or now_s < self._due_s:
            return
        if self._comparison is None:
            whole, since_s = map_trajectory(current), now_s - self._span_s
            if len(whole) and whole.t_s[0] <= since_s:
                path = map_trajectory(current, since_s)
                seen = Trajectory(path.t_s.copy(), path.world_T_camera.copy())
                self._due_s = now_s + _ANSWER_S
                self._comparison = begin(_compared, seen, imu, self._mount, current.aligned)
        elif self._config.online.repeatable or self._comparison.done():
            found, self._comparison = self._comparison.result(), None
            if found.finding is None:
                self._span_s = min(2.0 * self._span_s, _LONGEST_S)
                self._due_s = now_s + self._span_s / 2.0
            else:
                self._span_s, self._due_s = self._span_s + _AGAIN_S, now_s + _AGAIN_S - _ANSWER_S
                if found.finding == self._suspected:
                    self._follow(found, frame_pipeline, fusion)
            self._suspected = found.finding

    def _follow(self, found: Comparison, frame_pipeline: FramePipeline, fusion: LiveFusion) -> None:
        """Leave out or correct the IMU as a comparison says."""
        assert self.log is not None and self.at_camera is not None
        name, since = self.log.source.name, f"from {frame_pipeline.t_s[-1]:.1f} s on"
        turning, offset_s = found.turning, found.turning.time_offset_s
        if turning.contradiction is not None:
            note = (
                f"{name} is left out {since}: {turning.contradiction}; calibrate it with vgps calibrate-imu"
            )
            self.log = self.at_camera = frame_pipeline.gyro = None
            frame_pipeline.start_anew()
        elif turning.misled:
            note = (
                f"{name} is shifted by {offset_s:.4f} s {since} (standard deviation "
                f"{turning.time_offset_sigma_s:.4f} s), as its rotations and the video's show: add it to "
                "imu_time_offset_s in rig.yaml"
            )
            self.log = replace(self.log, t_s=self.log.t_s + offset_s)
            self.at_camera = replace(self.at_camera, t_s=self.at_camera.t_s + offset_s)
            frame_pipeline.gyro = RotationPredictor(self.at_camera, self._config.imu)
        else:
            note = (
                f"{name} only predicts rotations {since}: its specific force contradicts the path, and would "
                f"fit with {found.forces}"
            )
            self.log = self.at_camera = None
        frame_pipeline.warnings.append(note)
        fusion.use_imu(self.at_camera)


def _compared(path: Trajectory, imu: CameraImu, mount: ImuMount, in_world: bool) -> Comparison:
    """Return what a path says of an IMU; of its specific force if the path lies in the world."""
    forces = wrong_forces(path, imu, mount) if in_world else None
    return Comparison(agreement(path_rotations([path]), imu), forces)
