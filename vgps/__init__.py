"""The pose of every frame of a video in world coordinates, from the video and a GPS log."""

from importlib.metadata import version

from vgps.config import Config, read_config
from vgps.model import Recording
from vgps.online import Fix, OnlineEstimate, OnlineSmoother
from vgps.pipeline.offline import smooth
from vgps.readers.recording import open_recording
from vgps.solution import Solution
from vgps.writers.run_folder import write_run

__all__ = [
    "Config",
    "Fix",
    "OnlineEstimate",
    "OnlineSmoother",
    "Recording",
    "Solution",
    "__version__",
    "open_recording",
    "read_config",
    "smooth",
    "write_run",
]

__version__ = version("vgps")
