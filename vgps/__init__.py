"""The pose of every frame of a video in world coordinates, from the video and a GPS log.

Names are imported when they are first used, so that ``import vgps`` and ``vgps --help`` cost little.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vgps.config import Config, read_config
    from vgps.errors import VgpsError
    from vgps.evaluation import evaluate
    from vgps.localization import localize
    from vgps.model import Camera, Recording, Rig
    from vgps.online import Fix, OnlineEstimate, OnlineSmoother
    from vgps.pipeline.offline import smooth
    from vgps.readers.calibration.camera_file import read_camera
    from vgps.readers.recording import open_recording
    from vgps.smoothing.stage_d.run_graph import factor_graph
    from vgps.solution import Solution
    from vgps.writers.run_folder import write_run

__all__ = [
    "Camera",
    "Config",
    "Fix",
    "OnlineEstimate",
    "OnlineSmoother",
    "Recording",
    "Rig",
    "Solution",
    "VgpsError",
    "__version__",
    "evaluate",
    "factor_graph",
    "localize",
    "open_recording",
    "read_camera",
    "read_config",
    "smooth",
    "write_run",
]

_HOMES = {
    "Camera": "model",
    "Config": "config",
    "Fix": "online",
    "OnlineEstimate": "online",
    "OnlineSmoother": "online",
    "Recording": "model",
    "Rig": "model",
    "Solution": "solution",
    "VgpsError": "errors",
    "evaluate": "evaluation",
    "factor_graph": "smoothing.stage_d.run_graph",
    "localize": "localization",
    "open_recording": "readers.recording",
    "read_camera": "readers.calibration.camera_file",
    "read_config": "config",
    "smooth": "pipeline.offline",
    "write_run": "writers.run_folder",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = import_module("importlib.metadata").version("vgps")
    elif name in _HOMES:
        value = getattr(import_module(f"vgps.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module 'vgps' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
