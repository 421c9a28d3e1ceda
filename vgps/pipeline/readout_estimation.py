"""Stage D with the readout of a rolling shutter as given, or estimated where the video shows it."""

from dataclasses import replace

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.fixes import Fixes
from vgps.model import Camera, FloatArray
from vgps.pipeline.camera_refinement import optimise_camera
from vgps.pipeline.front_end import FrontEnd
from vgps.smoothing.calibration.readout import Readout, estimate_readout
from vgps.smoothing.calibration.refined_camera import RefinedCamera
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import Solution

Optimised = tuple[BatchResult, RefinedCamera | None, Readout | None]
"""Result of stage D, the refined camera, and the estimate of the readout, if there is one."""


def optimise_readout(
    front_end: FrontEnd, merged: MergedMaps, fixes: Fixes, config: Config, solved_with: Camera | None = None
) -> Optimised:
    """Optimise everything; once more with a readout if it is not known and the video shows one.

    ``solved_with`` is the refined camera of the solution at which the scene starts, if it does.

    Raises:
        GeometryError: No step lowers the cost.
    """
    given, setting = front_end.recording.camera, config.rolling_shutter
    wanted = setting.estimate == "yes" or (setting.estimate == "auto" and given.readout_s is None)
    starts_from_one = wanted and bool(given.readout_s)
    batch, refined = optimise_camera(front_end, merged, fixes, config, starts_from_one, solved_with)
    if not wanted or front_end.others or len(batch.trajectory) < 2:
        return batch, refined, None
    always = setting.estimate == "yes"
    found = _estimate(batch, refined.camera if refined else given, config)
    if found is None or starts_from_one or not (always or found.is_shown(setting.min_sigmas)):
        return batch, refined, found
    rolling = replace(given, readout_s=found.readout_s)
    started = replace(front_end, recording=replace(front_end.recording, camera=rolling))
    scene = replace(merged.scene, poses=batch.trajectory.world_T_camera, points=batch.points)
    again, camera = optimise_camera(
        started, replace(merged, scene=scene), fixes, config, True, refined.camera if refined else None
    )
    final = _estimate(again, camera.camera if camera else rolling, config)
    if final is None or not (always or final.is_shown(setting.min_sigmas)):
        return batch, refined, found
    return again, camera, final


def with_readout(solution: Solution, found: Readout, readout_s: float | None, config: Config) -> Solution:
    """Return the solution with an estimated readout, or with a warning that the motion does not show it.

    Args:
        solution: The solution.
        found: The estimate.
        readout_s: The readout of the result; None if it was taken for a global shutter.
        config: Settings.
    """
    sigmas = config.rolling_shutter.min_sigmas
    sigma_ms = 1e3 * found.sigma_s
    if readout_s is None:
        if found.would_show(sigmas):
            return solution
        note = (
            f"the motion does not show whether the shutter rolls (estimate {1e3 * found.readout_s:.1f} ms, "
            f"standard deviation {sigma_ms:.1f} ms), and it counts as global: give readout_s in camera.yaml"
        )
        return replace(solution, warnings=(*solution.warnings, note))
    note = f"the shutter rolls: {1e3 * readout_s:.1f} ms from first to last row (sigma {sigma_ms:.1f})"
    if not found.is_shown(sigmas):
        note += ", which may be chance"
    return replace(
        solution,
        camera=replace(solution.camera, readout_s=readout_s),
        sensors=replace(
            solution.sensors, camera_sigma={**solution.sensors.camera_sigma, "readout_s": found.sigma_s}
        ),
        warnings=(*solution.warnings, f"{note}; camera.yaml in the run folder has it"),
    )


def with_contradicted_readout(
    solution: Solution, batch: BatchResult, front_end: FrontEnd, config: Config
) -> Solution:
    """Return the solution with a warning if the video contradicts the readout that its camera has."""
    given_s = solution.camera.readout_s
    if given_s is None or config.rolling_shutter.estimate == "no" or front_end.others:
        return solution
    seen = _estimate(batch, solution.camera, config)
    if seen is None or not seen.contradicts(given_s, config.rolling_shutter.min_sigmas):
        return solution
    note = (
        f"the camera has a readout of {1e3 * given_s:.1f} ms, and the video shows {1e3 * seen.readout_s:.1f} "
        f"(standard deviation {1e3 * seen.sigma_s:.1f}): correct readout_s in camera.yaml (negative if the "
        "last row is read first), or leave it out to have it estimated"
    )
    return replace(solution, warnings=(*solution.warnings, note))


def readout_of(batch: BatchResult, camera: Camera, camera_sigma: FloatArray) -> Readout:
    """Return the readout to which a step from a solution leads.

    Args:
        batch: The solution.
        camera: Its camera.
        camera_sigma: (4,) standard deviations of the calibration, as for :func:`estimate_readout`.

    Raises:
        GeometryError: The poses are not determined.
    """
    as_seen = replace(batch.problem, uv_px=batch.observations.uv_px)
    return estimate_readout(as_seen, batch.trajectory.t_s, camera, camera_sigma)


def _estimate(batch: BatchResult, camera: Camera, config: Config) -> Readout | None:
    try:
        return readout_of(batch, camera, config.intrinsics.held_sigmas)
    except GeometryError:  # undetermined poses, of which the run warns anyway
        return None
