"""Verbs that turn a recording into a run."""

from pathlib import Path

from rich.console import Console

from vgps.cli.app import app, note, say
from vgps.cli.terminal import TerminalProgress
from vgps.config import GpsModel, read_config
from vgps.evaluation import evaluation_table
from vgps.pipeline.offline import smooth as smooth_recording
from vgps.readers.recording import open_recording
from vgps.runtime.timing import one_after_another
from vgps.solution import Solution
from vgps.writers.run_folder import check_writable, write_run


@app.command
def demo(*, out: Path = Path("demo"), seed: int = 0) -> None:
    """Simulate a short recording, smooth it, evaluate it against its truth, and say where the results are.

    Args:
        out: Folder for the recording, the run and its report.
        seed: Of the simulated world and its GPS errors.
    """
    from vgps.demo import demo as run_demo  # noqa: PLC0415  (plots and simulation are slow to import)

    solution, evaluation = run_demo(out, seed, TerminalProgress())
    _summary(solution, out / "run")
    Console().print(evaluation_table(evaluation, "against the simulation's exact truth"))
    say(f"recording: {out / 'recording'}\nresults:   {out / 'run'}\nreport:    {out / 'report.html'}")


@app.command
def smooth(
    recording: Path,
    *,
    out: Path,
    gps: str | None = None,
    gps_model: GpsModel | None = None,
    survey: Path | None = None,
    config: Path | None = None,
    camera: str | None = None,
    rig: str | None = None,
    control_points: str | None = None,
    seed: int | None = None,
) -> None:
    """Smooth a recording: the pose of every frame, in world coordinates.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log, or a video with these beside it.
        out: Run folder to write.
        gps: GPS log, a path or a name inside the folder.
        gps_model: How a fix acts on the path; a cylinder around it by default.
        survey: YAML with the region r_m, h_m of each fix class.
        config: YAML that overrides the defaults.
        camera: Another camera.yaml, or OpenCV's, Kalibr's or COLMAP's; a path or a name inside the folder.
        rig: Another rig.yaml, a path or a name inside the folder.
        control_points: Another control_points.csv, a path or a name inside the folder.
        seed: Of every random choice.
    """
    check_writable(out)
    settings = read_config(config).with_gps(gps_model, survey).with_seed(seed)
    opened = open_recording(recording, gps=gps, camera=camera, rig=rig, control_points=control_points)
    solution = smooth_recording(opened, settings, TerminalProgress())
    write_run(solution, out)
    _summary(solution, out)


def _summary(solution: Solution, out: Path) -> None:
    for warning in solution.warnings:
        note(warning)
    frames, seconds = len(solution.t_s), one_after_another(solution.seconds)
    used = 0 if solution.fixes is None else int(solution.fixes.used.sum())
    logged = 0 if solution.gps is None else len(solution.gps)
    speed = f"{seconds:.1f} s ({frames / max(seconds, 1e-9):.1f} frames/s)"
    say(f"{frames} frames posed, {used} of {logged} fixes used, {speed}: {out}")
