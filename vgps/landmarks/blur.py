"""Motion blur on templates: uniform motion along a line, each template along its own, (C) of Matsuda 2007."""

import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray, IntArray

Float32Array = npt.NDArray[np.float32]

_PER_PX = 1.0  # samples for each pixel of motion; bilinear, so that one is enough


def motion_taps(blur_px: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """The point spread function of uniform motion along ``blur_px``, centred, as whole-pixel taps.

    The line is cut into equal pieces; each puts its weight on the four pixels around its middle.

    Args:
        blur_px: (N, 2) motion (u, v) while the shutter is open.

    Returns:
        Offsets u and v, (N, T) pixels, and weights (N, T), each row summing to 1.
    """
    longest = float(np.abs(blur_px).max(initial=0.0))
    pieces = max(1, int(np.ceil(longest * _PER_PX)))
    along = (np.arange(pieces) + 0.5) / pieces - 0.5
    at = along[None, :, None] * blur_px[:, None, :]
    corner = np.floor(at).astype(np.int64)
    right, down = np.moveaxis(at - corner, -1, 0)
    u = np.concatenate([corner[..., 0] + i for i in (0, 1, 0, 1)], axis=1)
    v = np.concatenate([corner[..., 1] + j for j in (0, 0, 1, 1)], axis=1)
    share = [(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down]
    return u, v, np.concatenate(share, axis=1) / pieces


def blur_margin(blur_px: FloatArray) -> int:
    """Pixels that a patch needs beyond the template on every side."""
    return int(np.ceil(float(np.abs(blur_px).max(initial=0.0)) / 2)) + 1


def blur_patches(patches: Float32Array, blur_px: FloatArray, side: int) -> Float32Array:
    """Each patch blurred along its own motion.

    Args:
        patches: (N, S, S), S at least ``side + 2 * blur_margin(blur_px)`` and as odd as ``side``.
        blur_px: (N, 2) motion (u, v), pixels of the patch.
        side: Of the result.

    Returns:
        (N, side, side), the middle of each.
    """
    margin = (patches.shape[1] - side) // 2
    windows = np.lib.stride_tricks.sliding_window_view(patches, (side, side), axis=(1, 2))
    u, v, weight = motion_taps(blur_px)
    row = np.arange(len(patches))
    out = np.zeros((len(patches), side, side), np.float32)
    for k in range(u.shape[1]):
        used = weight[:, k].astype(np.float32)
        if used.any():
            # convolution takes what lies against the offset; the spread is symmetric, so either will do
            out += used[:, None, None] * windows[row, margin + v[:, k], margin + u[:, k]]
    return out
