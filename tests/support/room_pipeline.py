"""A frame pipeline fed with images of the textured room."""

import numpy as np
from synthetic_fixes import fixes_of_size
from textured_room import CAMERA, CONFIG, FPS, image, images, path

from vgps.gps.fixes import Fixes
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import Frame
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.smoothing.context import SmoothingContext

COUNT = 30
POSES = path(COUNT)


def exact_fixes(until=COUNT):
    """A fix every three frames on the camera's path: its antenna is the camera's centre."""
    frame = np.arange(0, until, 3)
    size = np.full(len(frame), 0.05)
    return fixes_of_size(frame / FPS, POSES[frame, :3, 3], size, size)


def pipeline(fixes=None, config=CONFIG, retention=None, controls=NO_CONTROL_OBSERVATIONS, live=False):
    fixes = Fixes.empty() if fixes is None else fixes
    return FramePipeline(SmoothingContext(CAMERA, config, controls), np.zeros(3), fixes, retention, live)


def room(count=COUNT, black=()):
    """Frames along the path; those in ``black`` show nothing."""
    for index, gray in enumerate(images(COUNT)[:count]):
        yield Frame(index, index / FPS, np.zeros_like(gray) if index in black else gray)


def fed(these, *args, **kwargs):
    made = pipeline(*args, **kwargs)
    for frame in these:
        made.add_frame(frame)
    made.finish()
    return made


def another_room(start, count=12):
    """Frames from ``start`` on, of another room along the beginning of the path."""
    return [Frame(i, i / FPS, image(POSES[i - start], seed=1)) for i in range(start, start + count)]


def errors_m(local_map, true=POSES):
    """Distance of every frame of an aligned map from where it was."""
    true = true[local_map.first_frame : local_map.next_frame, :3, 3]
    return np.linalg.norm(local_map.poses[:, :3, 3] - true, axis=1)
