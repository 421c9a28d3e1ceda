"""Pinhole views into a wide picture: faces of a cube around its lens, and their videos and masks."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from vgps.model import BoolArray, Camera, FloatArray, Frame, GrayImage, Masks, RgbImage
from vgps.readers.sources import Source
from vgps.readers.video.derived_video import DerivedVideo
from vgps.readers.views.lenses import WideLens

FACE_DEG = 95.0
"""Width of a view: a face of a cube and 2.5 degrees on each side, so that patches on an edge are whole."""

_X, _Y, _Z = np.eye(3)
_AXES = {  # x, y, z of each face: those around turn about the vertical, the others nod
    "front": (_X, _Y, _Z),
    "right": (-_Z, _Y, _X),
    "rear": (-_X, _Y, -_Z),
    "left": (_Z, _Y, -_X),
    "up": (_X, _Z, -_Y),
    "down": (_X, -_Z, _Y),
}


@dataclass(frozen=True)
class View:
    """A pinhole view into the picture of a wide lens.

    Attributes:
        name: Its face of the cube.
        camera: Its intrinsics, cut to what the lens sees.
        lens: The wide lens.
    """

    name: str
    camera: Camera
    lens: WideLens

    @property
    def lens_R_view(self) -> FloatArray:
        """(3, 3) rotation from the view's axes to those of the lens."""
        return np.column_stack(_AXES[self.name])

    @cached_property
    def source_px(self) -> FloatArray:
        """(H, W, 2) pixels of the wide picture, NaN where the lens does not see."""
        camera = self.camera
        u, v = np.meshgrid(np.arange(float(camera.width)), np.arange(float(camera.height)))
        rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
        uv = self.lens.pixels(rays.reshape(-1, 3) @ self.lens_R_view.T)
        return uv.reshape(camera.height, camera.width, 2)

    @cached_property
    def seen(self) -> BoolArray:
        """(H, W) where the lens sees."""
        return np.isfinite(self.source_px[..., 0])

    @cached_property
    def _maps(self) -> tuple[GrayImage, GrayImage]:
        uv = np.where(self.seen[..., None], self.source_px, 0.0).astype(np.float32)
        coarse, fine = cv2.convertMaps(uv, None, cv2.CV_16SC2)  # type: ignore[call-overload]
        return coarse, fine

    def picture(self, wide: GrayImage) -> GrayImage:
        """Return what the view shows of a wide picture (H, W) or (H, W, 3); black where it sees nothing."""
        # a picture of the whole sphere goes on at its other side
        remapped = cv2.remap(wide, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        shown = np.asarray(remapped, np.uint8)
        if not self.seen.all():
            shown[~self.seen] = 0
        return shown


def views_of(lens: WideLens) -> tuple[View, ...]:
    """Return the views of a lens, the one along its axis first."""
    return tuple(_cut(name, lens) for name in lens.faces)


def _cut(name: str, lens: WideLens) -> View:
    """Return the view of a face, cut to the rectangle that the lens sees of it."""
    f = lens.focal_px
    size = 2 * int(np.ceil(f * np.tan(np.radians(FACE_DEG / 2))))
    middle = (size - 1) / 2
    face = Camera(model="pinhole", width=size, height=size, fx=f, fy=f, cx=middle, cy=middle, readout_s=0.0)
    rows, columns = (np.flatnonzero(View(name, face, lens).seen.any(axis=axis)) for axis in (1, 0))
    left, top = int(columns[0]), int(rows[0])
    width, height = int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top
    camera = replace(face, width=width, height=height, cx=middle - left, cy=middle - top)
    return View(name, camera, lens)


@dataclass(frozen=True)
class ViewVideo(DerivedVideo):
    """The video of a view."""

    view: View

    @property
    def width(self) -> int:
        """Width in pixels."""
        return self.view.camera.width

    @property
    def height(self) -> int:
        """Height in pixels."""
        return self.view.camera.height

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the reader found; once, with the view along the axis."""
        return super().warnings if self.view.name == "front" else ()

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order of presentation."""
        return (replace(frame, gray=self.view.picture(frame.gray)) for frame in self.video.frames())

    def pictures(self, wanted: Collection[int]) -> Iterator[tuple[int, RgbImage]]:
        """Yield index and colours of some frames in order, of a video that a reader opened."""
        source = cast(Source, self.video)
        return ((index, self.view.picture(picture)) for index, picture in source.pictures(wanted))


@dataclass(frozen=True)
class ViewMasks:
    """Where a view shows the scene: where the lens sees, and as the masks of the wide picture say."""

    view: View
    masks: Masks | None

    @property
    def files(self) -> tuple[Path, ...]:
        """The masks of the wide picture."""
        return () if self.masks is None else tuple(self.masks.files)

    def of_frame(self, index: int) -> BoolArray | None:
        """Return where a frame shows the scene (H, W); None if everywhere."""
        wide = None if self.masks is None else self.masks.of_frame(index)
        if wide is None:
            return None if self.view.seen.all() else self.view.seen
        shown = self.view.picture(np.where(wide, np.uint8(255), np.uint8(0)))
        return np.asarray(shown == 255)
