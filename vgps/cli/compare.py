"""The verb ``compare``."""

from pathlib import Path

from rich.console import Console

from vgps.cli.app import print_line
from vgps.cli.options import SurveyedSettings

_SETTINGS = SurveyedSettings()


def compare(
    recording: Path,
    *,
    truth: Path,
    out: Path,
    gps: str | None = None,
    settings: SurveyedSettings = _SETTINGS,
) -> None:
    """Compare all GPS models on one recording with truth, as an HTML page and JSON.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log.
        truth: TUM file of world_T_camera in ENU; a rig.yaml beside it may give its origin and clock.
        out: Folder for comparison.html and comparison.json.
        gps: GPS log; a path, or a name inside the folder.
        settings: Settings.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.compare import check_outputs, write_comparison
    from vgps.compare import compare as compare_models
    from vgps.evaluation import comparison_table
    from vgps.readers.recording import open_recording

    config = settings.read()
    check_outputs(out)
    comparison = compare_models(
        open_recording(recording, gps=gps, guess_camera=False), truth, config, TerminalProgress()
    )
    page, data = write_comparison(comparison, out)
    Console().print(comparison_table(list(comparison.evaluations.items()), str(recording)))
    print_line(f"wrote {page} and {data}")
