"""Times of the samples of a GoPro's sensors, on the video's clock."""

from itertools import pairwise

import numpy as np

from vgps.model import FloatArray
from vgps.readers.gopro.gpmf import Block

_TOLERANCE_S = 0.5  # between a stamp and its packet's time; beyond it the stamps restart (joined clips)


def sample_times(sensor: list[Block], first_frame: Block | None = None) -> FloatArray:
    """Return (N,) times of all samples of a sensor, seconds from the video's first frame.

    STMP stamps the first sample of a payload; the others are spaced evenly up to the next payload's stamp, in
    the last payload at the rate before it. Where stamps are missing or restart, the samples are spread over
    the payload's time in the container, which is accurate to a few tenths of a second.

    Args:
        sensor: Its blocks, in order.
        first_frame: The first block of a stream with one sample per frame (SHUT), whose stamp is that of the
            first frame. Without it the stamps are aligned with the container's times by their median.
    """
    counts = [len(block.samples) for block in sensor]
    stamps = np.array([block.stamp_s for block in sensor])
    starts = np.array([block.start_s for block in sensor])
    ahead = stamps - starts
    if not np.isfinite(ahead).all() or np.ptp(ahead) > _TOLERANCE_S:
        firsts = starts
        steps = [block.duration_s / max(n, 1) for block, n in zip(sensor, counts, strict=True)]
    else:
        lead = float(np.median(ahead))
        frame = np.nan if first_frame is None else first_frame.stamp_s - first_frame.start_s
        firsts = stamps - (frame if abs(frame - lead) < _TOLERANCE_S else lead)
        steps = _steps(sensor, firsts, counts)
    each = zip(firsts.tolist(), steps, counts, strict=True)
    return np.concatenate([first + step * np.arange(n) for first, step, n in each])


def _steps(sensor: list[Block], firsts: FloatArray, counts: list[int]) -> list[float]:
    """Return the sample interval of each payload; before a gap and at the end, that of the payload before."""
    steps: list[float] = []
    step = sensor[0].duration_s / max(counts[0], 1)
    for index, (block, following) in enumerate(pairwise(sensor)):
        gap = abs(following.start_s - block.start_s - block.duration_s) > _TOLERANCE_S
        if counts[index] and not gap:
            step = float(firsts[index + 1] - firsts[index]) / counts[index]
        steps.append(step)
    return [*steps, step]
