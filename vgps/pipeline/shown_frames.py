"""The frames of a recording, with what they show that is not of the scene left out."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vgps.model import Frame, IntArray, Recording


def shown_frames(recording: Recording, left_out: IntArray | None = None) -> Iterator[Frame]:
    """Yield the frames of a recording with their masks.

    Args:
        recording: The recording.
        left_out: (n, 6) as in :class:`~vgps.solution.Solution`, left out of the masks; nothing by default.
    """
    masks, regions = recording.masks, np.zeros((0, 6), int) if left_out is None else left_out
    first, last = regions[:, :2].T
    for frame in recording.video.frames():
        mask = None if masks is None else masks.of_frame(frame.index)
        boxes = regions[(first <= frame.index) & (frame.index <= last), 2:]
        if len(boxes):
            mask = np.ones(frame.gray.shape, bool) if mask is None else mask.copy()
            for left, top, right, bottom in boxes.tolist():
                mask[top:bottom, left:right] = False
        yield frame if mask is None else replace(frame, mask=mask)
