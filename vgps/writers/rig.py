"""``rig.yaml`` with some keys changed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from vgps.readers.calibration.rig_file import read_rig
from vgps.writers.atomic import new_file


def write_rig(changes: Mapping[str, Any], out: Path, *, base: Path | None = None) -> None:
    """Write the rig of ``base``, if given, with some keys changed; ``base`` and ``out`` may be the same file.

    Comments are lost; other keys keep their values and order.

    Raises:
        CalibrationError: ``base`` or the result is not a valid rig.
        RunFolderError: ``out`` cannot be written.
    """
    content: dict[str, Any] = {}
    if base is not None:
        read_rig(base)
        content = yaml.safe_load(base.read_text(encoding="utf-8")) or {}
    with new_file(out) as scratch:
        text = yaml.safe_dump({**content, **changes}, sort_keys=False, default_flow_style=None, width=110)
        scratch.write_text(text, encoding="utf-8")
        read_rig(scratch)
