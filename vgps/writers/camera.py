"""``camera.yaml`` of a calibration that a run found."""

from pathlib import Path

import yaml

from vgps.camera import camera_fields
from vgps.solution import Solution
from vgps.writers.atomic import new_file


def write_camera(solution: Solution, out: Path) -> None:
    """Write the calibration of a run, with its standard deviations as a comment.

    Raises:
        RunFolderError: ``out`` cannot be written.
    """
    sigma = ", ".join(f"{name} {value:.2g}" for name, value in solution.sensors.camera_sigma.items())
    head = "# found by vgps from the video itself" if solution.camera_source else "# refined by vgps"
    head += f"; standard deviations (focal length as a share): {sigma}\n" if sigma else "\n"
    text = yaml.safe_dump(camera_fields(solution.camera), sort_keys=False, default_flow_style=None)
    with new_file(out) as scratch:
        scratch.write_text(head + text, encoding="utf-8")
