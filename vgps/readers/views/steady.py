"""The pictures of a camera whose focal length changes, scaled to one focal length.

So all stages, and all who show the pictures or cut from them, have one calibration for the whole video.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from vgps.model import (
    BoolArray,
    Camera,
    ControlPoints,
    FloatArray,
    FocalChanges,
    Frame,
    GrayImage,
    Masks,
    Recording,
    RgbImage,
)
from vgps.readers.sources import Source
from vgps.readers.video.derived_video import DerivedVideo


@dataclass(frozen=True)
class SteadyVideo(DerivedVideo):
    """A video whose pictures are scaled to one focal length.

    Beyond the edge of a picture are the gray values of its edge.
    """

    changes: FocalChanges

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order of presentation."""
        for frame in self.video.frames():
            yield replace(frame, gray=self._scaled(frame.gray, frame.t_s))

    def pictures(self, wanted: Collection[int]) -> Iterator[tuple[int, RgbImage]]:
        """Yield index and colours of some frames in order, of a video that a reader opened."""
        for index, picture in cast(Source, self.video).pictures(wanted):
            yield index, self._scaled(picture, float(self.times_s[index]))

    def _scaled(self, picture: GrayImage, t_s: float) -> GrayImage:
        return _scaled(picture, self.changes, t_s, cv2.INTER_CUBIC, cv2.BORDER_REPLICATE)


@dataclass(frozen=True)
class SteadyMasks:
    """Where scaled pictures show the scene: where there is a picture, and as its masks say."""

    video: SteadyVideo
    masks: Masks | None

    @property
    def files(self) -> tuple[Path, ...]:
        """The masks of the pictures."""
        return () if self.masks is None else tuple(self.masks.files)

    def of_frame(self, index: int) -> BoolArray | None:
        """Return where a frame shows the scene (H, W); None if everywhere."""
        mask = None if self.masks is None else self.masks.of_frame(index)
        if mask is None:
            mask = np.ones((self.video.height, self.video.width), bool)
        t_s, changes = float(self.video.times_s[index]), self.video.changes
        seen = _scaled(mask.astype(np.uint8), changes, t_s, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT) > 0
        return None if seen.all() else seen


def steady(recording: Recording, changes: FocalChanges) -> Recording:
    """Return a recording whose pictures are scaled to one focal length; its camera has the changes.

    Args:
        recording: Its pictures may be scaled already.
        changes: What its pictures show.
    """
    video, masks, camera = recording.video, recording.masks, recording.camera
    points, before = recording.control_points, camera.focal_changes
    if before is not None:
        changes = replace(changes, centre_px=before.centre_px)
    if points is not None:
        points = _scaled_points(points, changes, video.times_s)
    if before is not None:
        changes = before.followed_by(changes)
    video = video.video if isinstance(video, SteadyVideo) else video
    masks = masks.masks if isinstance(masks, SteadyMasks) else masks
    pictures = SteadyVideo(video, changes)
    return replace(
        recording,
        video=pictures,
        masks=SteadyMasks(pictures, masks),
        camera=replace(camera, focal_changes=changes),
        control_points=points,
    )


def as_posed(recording: Recording, camera: Camera) -> Recording:
    """Return a recording with its pictures as a run with this camera had them."""
    changes = camera.focal_changes
    return recording if changes is None or recording.camera.focal_changes else steady(recording, changes)


def _scaled(
    picture: GrayImage, changes: FocalChanges, t_s: float, interpolation: int, border: int
) -> GrayImage:
    """Return a picture (H, W) or (H, W, 3) as it would be without the change of its focal length."""
    shrink = float(1.0 / changes.ratio(t_s))
    shift = (1.0 - shrink) * np.array(changes.centre_px)
    size = picture.shape[1], picture.shape[0]
    M = np.column_stack([shrink * np.eye(2), shift])
    return np.asarray(cv2.warpAffine(picture, M, size, flags=interpolation, borderMode=border))


def _scaled_points(points: ControlPoints, changes: FocalChanges, t_s: FloatArray) -> ControlPoints:
    """Return control points where scaled pictures show them; those of frames that do not exist stay."""
    known = points.frame < len(t_s)
    ratio = np.ones(len(known))
    ratio[known] = changes.ratio(t_s[points.frame[known]])
    centre = np.array(changes.centre_px)
    return replace(points, uv_px=centre + (points.uv_px - centre) / ratio[:, None])
