"""Drives whose video drifts and whose fixes err as the fusion of live poses expects."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from synthetic_fixes import fixes_of_size

from vgps.config import Config
from vgps.gps.fixes import CLASSES
from vgps.gps.outlier_detection import FixAssessment
from vgps.model import FixClass
from vgps.online.fusion.fusion_fit import FitInput
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.video_path import VideoPath

ANTENNA = np.array([0.1, -1.0, 0.3])
ARM = LeverArm.within(ANTENNA)
INTERVAL_S, SPEED_M_S = 0.1, 8.0


class DrivingCamera:
    """A camera on a winding road at 8 m/s, which may vary, level, without drift: ``true`` (n, 4, 4).

    The road may begin straight.
    """

    def __init__(self, frames, varying=0.0, straight_s=0.0):
        self.t_s = INTERVAL_S * np.arange(frames)
        heading = 0.8 * np.sin(np.maximum(self.t_s - straight_s, 0.0) / 6.0)
        ahead = np.stack([np.sin(heading), np.cos(heading), np.zeros(frames)], axis=1)
        right = np.stack([np.cos(heading), -np.sin(heading), np.zeros(frames)], axis=1)
        self.true = np.tile(np.eye(4), (frames, 1, 1))
        self.true[:, :3, :3] = np.stack([right, np.tile([0.0, 0.0, -1.0], (frames, 1)), ahead], axis=2)
        speed_m_s = SPEED_M_S * (1.0 + varying * np.sin(self.t_s / 2.0))
        self.true[1:, :3, 3] = np.cumsum(INTERVAL_S * speed_m_s[:-1, None] * ahead[:-1], axis=0)

    def seen(self, rng=None, share=1.0, config=None):
        """The path that the video gives: exact, or with ``share`` of the drift that the settings allow."""
        poses, count = self.true.copy(), len(self.t_s)
        if rng is not None:
            drift = (config or Config()).drift
            one = share / np.sqrt(drift.knot_frames)
            scale = np.cumsum(drift.scale_sigma * one * rng.standard_normal(count))
            turn = 0.3 * np.radians(drift.rotation_sigma_deg) * one * rng.standard_normal((count, 3))
            R = Rotation.from_rotvec(np.cumsum(turn, axis=0)).as_matrix()
            steps = np.exp(scale)[1:, None, None] * R[1:] @ np.diff(self.true[:, :3, 3], axis=0)[:, :, None]
            poses[1:, :3, 3] = np.cumsum(steps[:, :, 0], axis=0)
            poses[:, :3, :3] = R @ self.true[:, :3, :3]
        return VideoPath(t_s=self.t_s, poses=poses, moving=np.ones(count, dtype=bool))

    def antenna(self):
        return self.true[:, :3, 3] + self.true[:, :3, :3] @ ANTENNA

    def fixes(self, kinds, offset, every=10):
        """A fix every so many frames with the class of ``kinds`` (n,) and an error of ``offset`` (n, 3)."""
        at, regions = np.arange(len(kinds)) * every, Config().gps.regions
        r_m, h_m = (np.array([getattr(regions[kind], name) for kind in kinds]) for name in ("r_m", "h_m"))
        fixes = fixes_of_size(self.t_s[at], self.antenna()[at] + offset, r_m, h_m)
        return replace(
            fixes,
            fix_class=np.array([CLASSES.index(kind) for kind in kinds]),
            correlation_s=np.array([regions[kind].correlation_s for kind in kinds]),
        )


def with_class_below(fixes):
    """The fixes of a drive, of which RTK-fixes may have the error of an RTK-float."""
    rtk, region = fixes.fix_class == CLASSES.index(FixClass.RTK_FIX), Config().gps.regions[FixClass.RTK_FLOAT]
    sizes = {"lower_r_m": region.r_m, "lower_h_m": region.h_m}
    return replace(fixes, **{name: np.where(rtk, size, np.nan) for name, size in sizes.items()})


def fixed_then_float(fixed, floating, offset_m, fixed_again=0):
    """Classes and errors of RTK-fixes followed by RTK-float with a constant offset, and RTK-fixes again."""
    counts = (fixed, floating, fixed_again)
    kinds = [FixClass.RTK_FIX] * fixed + [FixClass.RTK_FLOAT] * floating + [FixClass.RTK_FIX] * fixed_again
    wrong = np.repeat([0.0, 1.0, 0.0], counts)[:, None] * np.asarray(offset_m)
    return kinds, wrong


def fit_input(path, frames, fixes, last=None, delay_s=0.0):
    """What a fit to the first so many frames of a path starts from, if fixes come some time after they were
    taken."""
    rows = fixes.t_s <= path.t_s[frames - 1] - delay_s
    known_s = -np.inf if last is None else last.newest_s - delay_s
    return FitInput(
        path=VideoPath(t_s=path.t_s[:frames], poses=path.poses[:frames], moving=path.moving[:frames]),
        fixes=fixes.where(rows),
        number=np.flatnonzero(rows),
        is_new=fixes.t_s[rows] > known_s + 1e-6,
        assessment=FixAssessment.unassessed(int(rows.sum())),
        lever_arm=ARM,
        last=last,
    )
