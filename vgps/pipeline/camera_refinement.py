"""Stage D with the camera's calibration as given, refined from it, or refined from a guess."""

from dataclasses import replace

import numpy as np

from vgps.camera_calibration.calibrate import calibrate_from_pairs
from vgps.camera_calibration.lens import angles, parameters_of
from vgps.config import Config
from vgps.gps.fixes import Fixes
from vgps.model import Camera, CameraGuess, FloatArray, Recording
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.rough_solution import is_tied
from vgps.pipeline.solved_maps import merged_maps
from vgps.runtime.progress import Progress
from vgps.smoothing.calibration.refined_camera import CameraPrior, RefinedCamera, prior_about
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.scene.few_frames import MIN_VIEWS, for_few_frames, frame_step, held_frames, viewing_frames
from vgps.smoothing.scene.other_calibration import undistorted_by
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.smoothing.stage_d.intrinsics import Optimiser, estimate_camera, refine_camera
from vgps.solution import Solution

_MEASURED = 0.02  # a focal length known to this share is no assumption
_SHOWN_SHARE = 0.5  # of its prior sigma: the video shows a parameter whose own is smaller
# Of stage D, doubled in its last round, at most, before each step of the calibration. Where the last one has
# not converged, focal lengths may seem to change.
_STEP_ITERATIONS = 5
_SETTLED_SHARE = 0.02  # of the angles of a lens: by as much are the turns of its path wrong
_MOST_RUNS = 5  # of stages A to C by the video alone, until it shows the same lens again
_PARAMETERS = {"focal": "focal length", "cx": "centre x", "cy": "centre y", "k1": "k1", "k2": "k2"}


def with_found_camera(recording: Recording, config: Config, progress: Progress) -> Recording:
    """Return the recording with the camera that fits pairs of views best, unless it is calibrated.

    Stage D refines the camera; the one guess that is left is its prior.
    """
    if not recording.guesses:
        return recording
    progress.stage("calibrating the camera")
    found = calibrate_from_pairs(recording, config, progress)
    given = recording.camera
    camera = replace(found.camera, readout_s=given.readout_s, readout_axis=given.readout_axis)
    return replace(recording, camera=camera, guesses=(found.guess,))


def moved_far(camera: Camera, before: Camera, share: float) -> bool:
    """Whether a refined camera differs by more than a share, so that stages A to C deserve another run.

    Compared are the angles of rays half way to the corners and in them.
    """
    radii = np.array([0.5, 1.0]) * np.hypot(camera.width, camera.height) / 2
    one, other = (angles(each.model, parameters_of(each), radii) for each in (camera, before))
    return bool(np.any(np.abs(one / other - 1.0) > share))


def optimise_camera(
    front_end: FrontEnd,
    merged: MergedMaps,
    fixes: Fixes,
    config: Config,
    estimates_readout: bool = False,
    solved_with: Camera | None = None,
) -> tuple[BatchResult, RefinedCamera | None]:
    """Optimise everything, including the calibration if it was guessed or the settings ask for it.

    A readout that is estimated starts at that of the camera. ``solved_with`` is the refined calibration of an
    earlier solution at which the scene starts: the same poses with the recording's camera hardly fit it.
    """
    optimise = _optimiser(front_end, merged, fixes, config, estimates_readout)
    camera, guesses = front_end.recording.camera, front_end.recording.guesses
    refine, too_few = config.intrinsics.refine, viewing_frames(merged.scene) < MIN_VIEWS
    if refine == "no" or front_end.others or (refine == "auto" and too_few and not guesses):
        return optimise(merged.scene, camera), None
    every = frame_step(merged.scene, config)
    prior = _prior(guesses[0]) if guesses else prior_about(camera, config.intrinsics)
    if solved_with is None:
        return refine_camera(merged.scene, camera, prior, optimise, config.intrinsics, every)
    start = replace(solved_with, readout_s=camera.readout_s)
    scene = undistorted_by(start, camera, merged.scene)
    return refine_camera(scene, start, prior, optimise, config.intrinsics, every)


def with_seen_camera(front_end: FrontEnd, config: Config) -> Recording:
    """Return an uncalibrated recording with the camera as the video alone shows it, by a rough solution.

    Fixes show a lens, and a lens the clock of the fixes, only if the other one is right.

    Args:
        front_end: Stages A to C; their path may lead to a rough solution, though fixes bent it.
        config: Settings without fixes.

    Raises:
        GeometryError: The video does not determine the camera.
    """
    recording, (guess,) = front_end.recording, front_end.recording.guesses
    front_end = replace(front_end, recording=replace(recording, imu=None))
    merged = merged_maps(front_end, front_end.context(config))
    unused = replace(front_end.fixes, used=np.zeros_like(front_end.fixes.used))
    optimise, every = _optimiser(front_end, merged, unused, config), frame_step(merged.scene, config)
    found = estimate_camera(merged.scene, recording.camera, _prior(guess), optimise, config.intrinsics, every)
    return replace(recording, camera=found.camera)


def with_settled_camera(front_end: FrontEnd, config: Config, progress: Progress, torn: bool) -> Recording:
    """Return an uncalibrated recording with the camera that the video shows again by a path made with it.

    A path that was made with a lens far from the right one shows the way to it, but not how far.

    Args:
        front_end: Stages A to C, perhaps bent to the fixes.
        config: Settings.
        progress: Progress display.
        torn: The fixes have torn the path, so that it shows nothing.

    Raises:
        GeometryError: The video does not determine the camera.
    """
    alone, recording = config.with_gps("none"), front_end.recording
    for run in range(_MOST_RUNS):
        if run or torn:
            progress.stage("again without the fixes, to see the camera")
            front_end = run_front_end(recording, alone, progress)
        before, recording = recording.camera, with_seen_camera(front_end, alone)
        if not moved_far(recording.camera, before, _SETTLED_SHARE):
            break
    return recording


def _optimiser(
    front_end: FrontEnd, merged: MergedMaps, fixes: Fixes, config: Config, estimates_readout: bool = False
) -> Optimiser:
    """Return stage D of a run as a function of its scene and its camera."""
    tied = is_tied(front_end, merged, config)

    def optimise(
        scene: Scene, camera: Camera, every: int | None = None, sigma: FloatArray | None = None
    ) -> BatchResult:
        held = None if tied else held_frames(scene, config)
        used = config if every is None else for_few_frames(config, every, _STEP_ITERATIONS)
        if sigma is not None:
            used = _with_camera_sigmas(used, sigma)
        context = replace(
            front_end.context(used),
            camera=camera,
            estimates_readout=estimates_readout,
            rough=every is not None,
        )
        return optimise_batch(scene, fixes, front_end.sensors, context, held, merged.assessment)

    return optimise


def with_camera(solution: Solution, refined: RefinedCamera, recording: Recording) -> Solution:
    """Return the solution with the refined calibration, and a warning if it is not the given one."""
    notes: tuple[str, ...]
    if recording.guesses:
        notes = _notes(refined, recording.guesses[0])
    else:
        notes = (refined.note(solution.camera),) if refined.differs_from(solution.camera) else ()
    return replace(
        solution,
        camera=refined.camera,
        camera_source=recording.guesses[0].source if recording.guesses else None,
        sensors=replace(solution.sensors, camera_sigma=refined.sigma, focal_changes=refined.changes),
        warnings=(*solution.warnings, *notes),
    )


def with_held_guess(solution: Solution, recording: Recording) -> Solution:
    """Return the solution of an uncalibrated camera that the settings forbid to refine, with a warning."""
    (guess,) = recording.guesses
    note = (
        f"no camera.yaml: {guess.source}; pairs of views gave fx {solution.camera.fx:.1f} px, "
        "which was held: set intrinsics: {refine: auto}"
    )
    return replace(solution, camera_source=guess.source, warnings=(*solution.warnings, note))


def _prior(guess: CameraGuess) -> CameraPrior:
    return CameraPrior(guess.camera, guess.sigmas)


def _notes(refined: RefinedCamera, guess: CameraGuess) -> tuple[str, str]:
    """Return what was assumed of a camera; and what the video shows of it, and what it does not."""
    prior = dict(zip(_PARAMETERS, guess.sigmas.tolist(), strict=True))
    held = [name for key, name in _PARAMETERS.items() if refined.sigma[key] > _SHOWN_SHARE * prior[key]]
    if prior["focal"] < _MEASURED and "focal length" in held:
        held.remove("focal length")  # it was measured, not assumed
    shown = "the motion shows all of it"
    if held:
        shown = f"the motion does not show {', '.join(held)}, held near what was assumed"
    assumed = f"no camera.yaml: {guess.source}, uncertain by {100 * guess.focal_sigma:.2g} %"
    return assumed, f"{refined.note(guess.camera)}; {shown}; camera.yaml in the run folder has the result"


def _with_camera_sigmas(config: Config, sigma: FloatArray) -> Config:
    """Return settings by which the poses' sigmas include those of a found calibration."""
    changes = {
        "held_focal_sigma": float(sigma[0]),
        "held_centre_sigma_px": float(sigma[1:3].max()),
        "held_radial_sigma": float(sigma[3]),
    }
    return config.model_copy(update={"intrinsics": config.intrinsics.model_copy(update=changes)})
