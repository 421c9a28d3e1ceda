"""Several runs as one scene: one world, one clock with gaps, and one pinhole camera for all observations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgps.camera import in_pinhole
from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes
from vgps.mapping.control_observations import ControlObservations
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import Camera, FloatArray, IntArray
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.solution import Observations

_GAP_S = 1e4  # between two runs: long enough for a receiver to forget its errors


@dataclass(frozen=True, kw_only=True)
class JointScene:
    """Runs as one scene.

    Attributes:
        scene: All frames and landmarks, run after run; pixels are those of ``camera``.
        fixes: All fixes, as if every antenna stood where the first run's does.
        camera: The first run's camera as a pinhole.
        camera_p_antenna: (3,) the first run's lever arm.
        frames: (R + 1,) rows at which the frames of each run begin.
        world_T_runs: (R, 4, 4) from the world of each run to that of the first.
    """

    scene: Scene
    fixes: Fixes
    camera: Camera
    camera_p_antenna: FloatArray
    frames: IntArray
    world_T_runs: FloatArray

    @property
    def run(self) -> IntArray:
        """(F,) number of the run of each frame."""
        return np.repeat(np.arange(len(self.world_T_runs)), np.diff(self.frames))


def joint_scene(inputs: Sequence[BatchInput], world_T_runs: FloatArray) -> JointScene:
    """Return runs as one scene, in the world of the first.

    Args:
        inputs: What stage D minimised last for each run, at its end.
        world_T_runs: (R, 4, 4) from the world of each run to that of the first.
    """
    camera = inputs[0].context.camera
    camera = replace(camera, model="pinhole", distortion=(), focal_changes=None)
    frames = np.cumsum([0, *(len(one.scene.t_s) for one in inputs)])
    shift_s, end_s = [], 0.0
    for one in inputs:
        shift_s.append(end_s - float(one.scene.t_s[0]))
        end_s += float(one.scene.t_s[-1] - one.scene.t_s[0]) + _GAP_S
    scenes, fixes = [], []
    for k, (one, T) in enumerate(zip(inputs, world_T_runs, strict=True)):
        scene = _moved(one.scene, T, int(frames[k]))
        scenes.append(_in_camera(scene, one.context.camera, camera))
        lever = inputs[0].sensors.camera_p_antenna - one.sensors.camera_p_antenna
        fixes.append(_moved_fixes(one.fixes, scene, T, lever, shift_s[k]))
    return JointScene(
        scene=_stacked(scenes, shift_s),
        fixes=_stacked_fixes(fixes),
        camera=camera,
        camera_p_antenna=inputs[0].sensors.camera_p_antenna,
        frames=frames,
        world_T_runs=world_T_runs,
    )


def _moved(scene: Scene, world_T_run: FloatArray, first: int) -> Scene:
    """Return a scene in another world, its frames counted from ``first``."""
    R, p, controls = world_T_run[:3, :3], world_T_run[:3, 3], scene.controls
    return replace(
        scene,
        poses=world_T_run @ scene.poses,
        points=scene.points @ R.T + p,
        observations=replace(scene.observations, frame=scene.observations.frame + first),
        zero_motions=tuple(
            ZeroMotion(one.frame + first, one.reference + first, one.reference_T_frame, one.sigma)
            for one in scene.zero_motions
        ),
        controls=replace(
            controls, frame=controls.frame + first, world_p_point=controls.world_p_point @ R.T + p
        ),
    )


def _in_camera(scene: Scene, before: Camera, after: Camera) -> Scene:
    observations, controls = scene.observations, scene.controls
    return replace(
        scene,
        observations=replace(observations, uv_px=in_pinhole(observations.uv_px, before, after)),
        controls=replace(controls, uv_px=in_pinhole(controls.uv_px, before, after)),
    )


def _moved_fixes(
    fixes: Fixes, scene: Scene, world_T_run: FloatArray, lever: FloatArray, shift_s: float
) -> Fixes:
    """Return fixes in another world, of an antenna further by ``lever`` (3,) in the camera's frame."""
    placement = place(scene.t_s, fixes.t_s)
    nearest = placement.frame + np.round(placement.alpha).astype(np.int64)
    position = fixes.world_p_fix @ world_T_run[:3, :3].T + world_T_run[:3, 3]
    position = position + scene.poses[nearest, :3, :3] @ lever
    return replace(fixes, world_p_fix=position, t_s=fixes.t_s + shift_s)


def _stacked(scenes: Sequence[Scene], shift_s: Sequence[float]) -> Scene:
    def rows(name: str) -> FloatArray:
        return np.concatenate([getattr(one.controls, name) for one in scenes])

    first = np.cumsum([0, *(len(one.points) for one in scenes[:-1])])  # landmark of each run
    observations = [
        replace(one.observations, landmark=one.observations.landmark + begin)
        for one, begin in zip(scenes, first, strict=True)
    ]
    return Scene(
        t_s=np.concatenate([one.t_s + shift for one, shift in zip(scenes, shift_s, strict=True)]),
        poses=np.concatenate([one.poses for one in scenes]),
        points=np.concatenate([one.points for one in scenes]),
        observations=Observations.stacked(observations),
        zero_motions=tuple(held for one in scenes for held in one.zero_motions),
        controls=ControlObservations(
            rows("frame").astype(np.int64), rows("uv_px"), rows("world_p_point"), rows("sigma_m")
        ),
    )


def _stacked_fixes(parts: Sequence[Fixes]) -> Fixes:
    whole = Fixes.empty()
    for part in parts:
        whole, _ = whole.merged(part)  # runs follow each other, so that the order is theirs
    return whole
