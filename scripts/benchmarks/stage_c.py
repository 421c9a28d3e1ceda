"""Is stage C better by iSAM2 or by the window of held frames?

For each log and solver, with and without drift correction: the error of every frame's pose when its first
window has just been used, once the map is in the world; the mean error of the result of stage D; processor
seconds of stages A to C; and windows in which iSAM2 failed.
"""

import itertools

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_recording_and_logs
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from scripts.common.stopwatch import stopwatch
from vgps.config import WindowConfig
from vgps.geometry import interpolate_poses
from vgps.gps.world_frame import world_fixes
from vgps.model import FloatArray, Recording
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.pipeline.front_end import front_end_of
from vgps.pipeline.offline import optimise_all
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.context import SmoothingContext

COLUMNS = [
    "log",
    "solver",
    "drift corrected",
    "after C [m]",
    "largest [m]",
    "stage D [m]",
    "A-C [s]",
    "fails",
]


def configuration(solver: str, corrects_drift: bool) -> vgps.Config:
    """Return the settings; without drift correction no fix contradicts the map."""
    window = WindowConfig.model_validate({"solver": solver})
    if not corrects_drift:  # a copy is not validated: the setting allows less
        window = window.model_copy(update={"tolerated_drift": 1e6, "min_shared_fixes": 1_000_000})
    return vgps.Config(window=window)


def one_run(recording: Recording, true: FloatArray, config: vgps.Config) -> dict[str, float | int]:
    """Return errors, seconds and failures of one run.

    Args:
        recording: With fixes.
        true: (F, 3) true positions of the camera, in its world.
        config: The settings.

    Raises:
        VgpsError: The recording cannot be smoothed.
    """
    origin, fixes = world_fixes(recording, config)
    context = SmoothingContext(recording.camera, config)
    frame_pipeline = FramePipeline(context, recording.rig.camera_p_antenna, fixes)
    # until its first window was optimised and used
    wait, errors = config.window.every_frames + config.window.delay_frames, list[float]()
    with stopwatch() as elapsed, one_blas_thread():
        for frame in recording.video.frames():
            frame_pipeline.add_frame(frame)
            current, past = frame_pipeline.current, frame.index - wait
            if current is not None and current.aligned and current.first_posed <= past < current.next_frame:
                errors.append(float(np.linalg.norm(current.pose(past)[:3, 3] - true[past])))
        frame_pipeline.finish_window()
    solution = optimise_all(front_end_of(frame_pipeline, recording, origin), config)
    after = np.linalg.norm(solution.world_T_camera[:, :3, 3] - true, axis=1)
    return {
        "after_c_m": float(np.mean(errors)),
        "max_m": max(errors),
        "stage_d_m": float(after.mean()),
        "cpu_s": elapsed.cpu_s,
        "failures": frame_pipeline.window_failures,
    }


def main() -> None:
    """Print a row per run as it comes."""
    parser = ScriptParser("benchmarks.stage_c", __doc__)
    add_recording_and_logs(parser)
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        truth = read_truth(given.recording)
        for log in given.logs:
            recording = vgps.open_recording(given.recording, gps=log)
            times = np.asarray(recording.video.times_s)
            true = interpolate_poses(truth.t_s, truth.world_T_camera, times)[:, :3, 3]
            for solver, corrects_drift in itertools.product(("schur", "isam2"), (True, False)):
                found = one_run(recording, true, configuration(solver, corrects_drift))
                what = {"log": log, "solver": solver, "corrects_drift": corrects_drift}
                results.add(**what, **found)
                table.add(*what.values(), *found.values())


if __name__ == "__main__":
    main()
