"""Motion blur on templates: uniform motion along a line, each template along its own, (C) of Matsuda 2007."""

import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray, IntArray

Float32Array = npt.NDArray[np.float32]


def motion_taps(blur_px: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """The point spread function of uniform motion along ``blur_px``, centred, as whole-pixel taps.

    The line is cut at half pixels of its longer axis; each piece puts its weight on the two pixels nearest to
    its middle along the other axis.

    Args:
        blur_px: (N, 2) motion (u, v) while the shutter is open.

    Returns:
        Offsets u and v, (N, T) pixels, and weights (N, T), each row summing to 1.
    """
    steep = np.abs(blur_px[:, 1]) > np.abs(blur_px[:, 0])
    major, minor = np.where(steep[:, None], blur_px[:, ::-1], blur_px).T
    length = np.maximum(np.abs(major), 1e-6)
    reach = int(np.ceil(length.max(initial=0.0) / 2 + 0.5)) - 1
    edges = np.clip(np.arange(-reach, reach + 2) - 0.5, -length[:, None] / 2, length[:, None] / 2)
    share = np.diff(edges, axis=1) / length[:, None]
    middle = (edges[:, 1:] + edges[:, :-1]) / 2 * (minor / np.where(major == 0, 1e-6, major))[:, None]
    low = np.floor(middle).astype(np.int64)
    along = np.broadcast_to(np.arange(-reach, reach + 1), low.shape)
    along, across = np.hstack([along, along]), np.hstack([low, low + 1])
    weight = np.hstack([share * (1 - (middle - low)), share * (middle - low)])
    u, v = np.where(steep[:, None], across, along), np.where(steep[:, None], along, across)
    return u, v, weight


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
