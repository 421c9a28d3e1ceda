"""The lens of a recording: one that a pinhole view holds, or a wider one and its views."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from vgps.errors import CalibrationError, RecordingError, VideoError
from vgps.model import Camera, Recording, RigCamera, Video
from vgps.readers.bag import BagVideo
from vgps.readers.calibration.camera_file import read_camera_of
from vgps.readers.calibration.yaml_fields import Fields, Pixels, mapping_of, validated
from vgps.readers.gopro.chapters import ChapteredVideo
from vgps.readers.sources import Source
from vgps.readers.table import read_bytes
from vgps.readers.video.images import ImageFolder
from vgps.readers.video.mp4_boxes import read_boxes
from vgps.readers.video.video_file import VideoFile
from vgps.readers.views.lenses import Equirectangular, WideFisheye, WideLens, wide_fisheye
from vgps.readers.views.view import FACE_DEG, View, ViewMasks, ViewVideo, views_of

_MODEL = "equirectangular"
_XMP_BYTES = 1 << 17  # of an image's beginning, where its XMP is
_GPANO = re.compile(rb"GPano:ProjectionType\W{1,4}equirectangular")
_FLAT_STEREO = {b"", b"\0"}  # stereo_mode of the box st3d: one picture
Lens = Camera | Equirectangular | WideFisheye


class _SphereFields(Fields):
    model: Literal["equirectangular"]
    width: Pixels
    height: Pixels


def read_lens(file: Path | None, video: Source) -> Lens | None:
    """Return the lens of a calibration, of a bag or of the marks in a video; None if none of them says it.

    Raises:
        CalibrationError: From :func:`read_camera_of`; or an equirectangular picture is of another size.
        VideoError: A video is marked as equirectangular, and not twice as wide as high.
    """
    if file is None:
        camera = video.camera() if isinstance(video, BagVideo) else None
        sphere = _sphere_of(video) if camera is None and is_marked(video) else None
    else:
        sphere = _given_sphere(file, video)
        camera = read_camera_of(video, file) if sphere is None else None
    return sphere or (None if camera is None else wide_fisheye(camera) or camera)


def is_marked(video: Video) -> bool:
    """Whether a file says that its pictures are equirectangular, one for both eyes.

    Spherical Video (boxes ``sv3d`` and ``st3d``, or RDF in ``uuid``) marks videos, Photo Sphere XMP images.
    """
    if isinstance(video, ImageFolder):
        with video.files[0].open("rb") as stream:
            return _GPANO.search(stream.read(_XMP_BYTES)) is not None
    if not isinstance(video, VideoFile | ChapteredVideo):
        return False
    entries = b"".join(read_boxes(video.path, "moov", "trak", "mdia", "minf", "stbl", "stsd"))
    marks = b"".join(read_boxes(video.path, "moov", "trak", "uuid"))
    eyes = entries.partition(b"st3d")[2][4:5]
    new = b"equi" in entries.partition(b"sv3d")[2] and eyes in _FLAT_STEREO
    stereo = re.search(rb"StereoMode>\s*(?!mono)\w", marks)
    return new or (b"GSpherical" in marks and b">equirectangular<" in marks and stereo is None)


def front_of(lens: Lens) -> Camera:
    """Return the camera that a run is about: that of a lens, or the view along the axis of a wide one."""
    return lens if isinstance(lens, Camera) else views_of(lens)[0].camera


def with_views(recording: Recording, lens: Lens | None, *, all_views: bool) -> Recording:
    """Return the recording of a wide lens as seen through its views; as it is for others.

    Args:
        recording: Its video and masks are those of the wide picture.
        lens: Its lens.
        all_views: Whether to add the views that are not along the axis.

    Raises:
        RecordingError: There are control points, which are pixels of the wide picture.
    """
    if lens is None or isinstance(lens, Camera):
        return recording
    if recording.control_points is not None:
        raise RecordingError(
            "control points in a picture that is seen through several views",
            file=recording.path,
            expected="a lens of less than 180 degrees",
            remedy="leave control_points.csv out",
        )
    on_axis = RigCamera(
        name="",
        video=recording.video,
        camera=recording.camera,
        reference_T_camera=np.eye(4),
        sigma=np.zeros(6),
        masks=recording.masks,
    )
    front, *others = views_on_rig(on_axis, lens)
    note = _note(recording.video, lens)
    return replace(
        recording,
        video=front.video,
        camera=front.camera,
        masks=front.masks,
        cameras=(*others, *recording.cameras) if all_views else (),
        notes=(*recording.notes, note),
    )


def views_on_rig(camera: RigCamera, lens: Lens) -> tuple[RigCamera, ...]:
    """Return a camera of a rig as its views, whose rotations are known; itself if its lens is not wide."""
    if isinstance(lens, Camera):
        return (camera,)
    return tuple(_view_on_rig(camera, view) for view in views_of(lens))


def _view_on_rig(camera: RigCamera, view: View) -> RigCamera:
    camera_T_view = np.eye(4)
    camera_T_view[:3, :3] = view.lens_R_view
    masks = ViewMasks(view, camera.masks)
    return replace(
        camera,
        name=f"{camera.name}_{view.name}" if camera.name else view.name,
        video=ViewVideo(camera.video, view),
        camera=view.camera,
        reference_T_camera=camera.reference_T_camera @ camera_T_view,
        masks=None if camera.masks is None and view.seen.all() else masks,
    )


def _note(video: Video, lens: WideLens) -> str:
    """Return what is done with the picture of a wide lens."""
    what = "a fisheye of more than 180 degrees"
    if isinstance(lens, Equirectangular):
        what = "an equirectangular picture of the whole sphere"
    readout = getattr(getattr(lens, "camera", None), "readout_s", None)
    rolling = "; its rolling shutter is not modelled" if readout else ""
    views = ", ".join(lens.faces)
    return (
        f"{video.path.name}: {what}, seen through {len(lens.faces)} views of {FACE_DEG:g} degrees ({views}); "
        f"poses, pictures and exports are of the view named {lens.faces[0]}{rolling}"
    )


def _given_sphere(file: Path, video: Source) -> Equirectangular | None:
    """Return the picture of a calibration that says ``model: equirectangular``; None for others."""
    if _MODEL.encode() not in read_bytes(file, CalibrationError):
        return None
    fields = validated(_SphereFields, mapping_of(file), file)
    if (fields.width, fields.height) != (video.width, video.height):
        raise CalibrationError(
            f"a picture of {fields.width} x {fields.height}",
            file=file,
            expected=f"{video.width} x {video.height} as in {video.path}",
        )
    return _sphere_of(video)


def _sphere_of(video: Source) -> Equirectangular:
    if video.width != 2 * video.height:
        raise VideoError(
            f"an equirectangular picture of {video.width} x {video.height}",
            file=video.path,
            expected="one twice as wide as high, of the whole sphere",
            remedy="export the whole sphere from the camera's software",
        )
    return Equirectangular(video.width, video.height)
