"""The pose of every frame of a video in world coordinates, from the video and a GPS log."""

from importlib.metadata import version

from vgps.config import Config, read_config
from vgps.errors import VgpsError
from vgps.evaluation import evaluate
from vgps.localization import localize
from vgps.model import Camera, Recording, Rig
from vgps.online import Fix, OnlineEstimate, OnlineSmoother
from vgps.pipeline.offline import smooth
from vgps.readers.calibration import read_camera
from vgps.readers.recording import open_recording
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
    "localize",
    "open_recording",
    "read_camera",
    "read_config",
    "smooth",
    "write_run",
]

__version__ = version("vgps")
