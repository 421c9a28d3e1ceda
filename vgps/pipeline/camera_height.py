"""Scale from the camera's known height above the ground that it moves over."""

from dataclasses import replace

import numpy as np

from vgps.config import CameraHeightConfig, Config, StartConfig
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.rough_solution import is_tied
from vgps.smoothing.merging.merge_maps import SCALE_UNKNOWN, MergedMaps
from vgps.smoothing.scene.camera_heights import CameraHeights, measure_heights
from vgps.smoothing.scene.height_ties import CAMERA_HEIGHT, HeightTies
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import Solution
from vgps.solver.landmark_refinement import move_with_frames

_CONTRADICTION = 3.0  # standard deviations
# Of the height, for all landmarks together: a patch of the ground is followed as if it faced the camera, so
# that its flow, with the square of its distance y [px] from the horizon, counts larger by (15^2 / 12) / y^2.
_COMMON = 0.01


def tie_to_ground(front_end: FrontEnd, merged: MergedMaps, config: Config) -> MergedMaps:
    """Return the maps with the lengths that a known height gives, and a warning that says what it gives.

    Where nothing else gives the scale, the path is brought to it, and its drift in scale is taken out.
    """
    height_m = config.camera_height.m
    if not height_m:
        return merged
    heights = measure_heights(_upright(merged.scene, config.start))
    if isinstance(heights, str):
        note = f"camera_height is left out: {heights}"
        return replace(merged, warnings=(*merged.warnings, note))
    ties = _ties(merged.scene, heights, config.camera_height)
    scene, warnings = merged.scene, merged.warnings
    if not is_tied(front_end, merged, config):
        scene = _scaled(scene, heights, height_m)
        warnings = tuple(one.replace(*SCALE_UNKNOWN) for one in warnings)
    return replace(merged, scene=replace(scene, heights=ties), warnings=(*warnings, _note(heights, ties)))


def with_camera_height(solution: Solution, merged: MergedMaps, batch: BatchResult) -> Solution:
    """Return the solution with the height that stage D found, and a warning if the given one is wrong."""
    ties = merged.scene.heights
    if ties is None:
        return solution
    found_m, (given_m, sigma_m) = float(batch.problem.shared[CAMERA_HEIGHT][0]), ties.prior_m.tolist()
    report = {"m": found_m, "scale_sigma": ties.scale_sigma, "stretches": float(len(ties.ratio))}
    solution = replace(solution, sensors=replace(solution.sensors, camera_height=report))
    if abs(found_m - given_m) < _CONTRADICTION * sigma_m:
        return solution
    note = (
        f"camera_height contradicts the fixes or control points: by them the camera is {found_m:.2f} m above "
        f"the ground, not {given_m:.2f} m (sigma {sigma_m:.2f}); check both"
    )
    return replace(solution, warnings=(note, *solution.warnings))


def _upright(scene: Scene, config: StartConfig) -> Scene:
    """Return a scene whose camera is not turned about its axis of view."""
    poses = scene.poses.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ config.upright
    return replace(scene, poses=poses)


def _ties(scene: Scene, heights: CameraHeights, config: CameraHeightConfig) -> HeightTies:
    centre = scene.poses[:, :3, 3]
    distance = np.linalg.norm(centre[heights.last] - centre[heights.first], axis=1)
    return HeightTies(
        first=heights.first,
        last=heights.last,
        ratio=heights.height / distance,
        sigma=heights.sigma,
        prior_m=np.array([config.m, np.hypot(config.sigma_m, _COMMON * config.m)]),
    )


def _scaled(scene: Scene, heights: CameraHeights, height_m: float) -> Scene:
    """Return a scene about its first frame with the camera everywhere at that height above the ground."""
    middle = 0.5 * (heights.first + heights.last)
    frames = np.arange(len(scene.poses))
    scale = height_m / np.exp(np.interp(frames, middle, np.log(heights.height)))
    poses = scene.poses.copy()
    steps = np.diff(poses[:, :3, 3], axis=0) * 0.5 * (scale[1:] + scale[:-1])[:, None]
    poses[1:, :3, 3] = poses[0, :3, 3] + np.cumsum(steps, axis=0)
    anchor = np.zeros(len(scene.points), dtype=np.int64)
    np.maximum.at(anchor, scene.observations.landmark, scene.observations.frame)
    points = move_with_frames(scene.points, scene.poses, poses, anchor, scale[anchor])
    return replace(scene, poses=poses, points=points)


def _note(heights: CameraHeights, ties: HeightTies) -> str:
    return (
        f"camera_height {ties.prior_m[0]:g} m gives the scale to {100 * ties.scale_sigma:.1f} %: "
        f"{len(ties.ratio)} of {heights.stretches} stretches of the path have a plane below them"
    )
