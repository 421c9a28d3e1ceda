"""Other cameras of a rig: their videos on the clock of the recording's own."""

from collections import Counter
from pathlib import Path

import numpy as np

from vgps.errors import CalibrationError, RecordingError, VideoError
from vgps.model import Recording, RigCamera, Video
from vgps.readers.calibration.projection_checks import CUT_A_VIEW
from vgps.readers.calibration.rig_file import CameraFields, RigFields
from vgps.readers.calibration.yaml_fields import read_fields
from vgps.readers.gopro.lens import with_readout
from vgps.readers.gopro.stabilisation import is_stabilised
from vgps.readers.sources import Source, opened, telemetry_of
from vgps.readers.video.masks import MASKS, MaskFolder
from vgps.readers.video.retimed_video import RetimedVideo
from vgps.readers.views.view import ViewVideo
from vgps.readers.views.wide_pictures import Lens, front_of, read_lens, views_on_rig


def open_cameras(rig_file: Path, video: Source, lens: Lens | None) -> tuple[RigCamera, ...]:
    """Open the other cameras of a rig.

    Args:
        rig_file: Names their files, which are beside it.
        video: Video of the reference camera.
        lens: Its lens, which is also that of cameras without their own; None if it is not known. A camera
            with a wide one becomes its views.

    Raises:
        RecordingError: A video is missing, or is never recorded at the time of the reference.
        CalibrationError: Two cameras have one name, or a camera has no calibration, or one of another size.
        VideoError: A video cannot be read, or its picture moves on the camera.
    """
    listed = read_fields(RigFields, rig_file).cameras
    if not listed:
        return ()
    if lens is None:
        raise CalibrationError(
            "no camera.yaml beside a rig of several cameras",
            file=rig_file,
            remedy="calibrate each camera alone: vgps calibrate-camera VIDEO --out camera.yaml",
        )
    name, count = Counter(one.name for one in listed).most_common(1)[0]
    if count > 1:
        raise CalibrationError(
            f"{count} cameras named {name}", file=rig_file, place="key cameras", expected="distinct names"
        )
    _check_rigid(video)
    return tuple(view for one in listed for view in _opened(one, rig_file, video, lens))


def refuse_several(recording: Recording, verb: str) -> None:
    """Refuse a rig of several cameras.

    Raises:
        RecordingError: The recording has other cameras, or a picture that is seen through several views.
    """
    if isinstance(recording.video, ViewVideo):
        raise RecordingError(
            f"a picture of more than 180 degrees, seen through {1 + len(recording.cameras)} views",
            file=recording.path,
            expected=f"one view, as {verb} takes it",
            remedy=f"cut an ordinary view out of it ({CUT_A_VIEW})",
        )
    if recording.cameras:
        raise RecordingError(
            f"a rig of {1 + len(recording.cameras)} cameras",
            file=recording.path,
            expected=f"one camera, as {verb} takes it",
            remedy="name a rig.yaml without the key cameras: --rig FILE",
        )


def _check_rigid(video: Source) -> None:
    if is_stabilised(telemetry_of(video)):
        raise VideoError(
            "the picture is stabilised, so that it turns on the rig",
            file=video.path,
            remedy="record with stabilisation off, or smooth each camera alone",
        )


def _opened(fields: CameraFields, rig_file: Path, reference: Source, shared: Lens) -> tuple[RigCamera, ...]:
    file, name = rig_file.parent / fields.video, fields.name
    if not file.exists():
        raise RecordingError(f"no video {fields.video} of camera {name}", file=rig_file, place="key cameras")
    source = opened(file)
    _check_rigid(source)
    lens = _lens(fields, rig_file, source, shared)
    later_s = fields.time_offset_s
    video: Video = RetimedVideo(source, source.times_s + later_s) if later_s else source
    first_s, last_s = reference.times_s[[0, -1]]
    if not np.any((video.times_s >= first_s) & (video.times_s <= last_s)):
        raise RecordingError(
            f"camera {name} is recorded from {video.times_s[0]:.2f} to {video.times_s[-1]:.2f} s",
            file=rig_file,
            place="key cameras",
            expected=f"frames from {first_s:.2f} to {last_s:.2f} s, as in {reference.path.name}",
            remedy="check time_offset_s",
        )
    masks = rig_file.parent / MASKS / name
    opened_camera = RigCamera(
        name=name,
        video=video,
        camera=with_readout(front_of(lens), telemetry_of(source), getattr(source, "quarter_turns", 0)),
        reference_T_camera=fields.reference_T_camera(rig_file),
        sigma=fields.sigma,
        masks=MaskFolder(masks, source) if masks.is_dir() else None,
    )
    return views_on_rig(opened_camera, lens)


def _lens(fields: CameraFields, rig_file: Path, source: Source, reference: Lens) -> Lens:
    """Return the calibration of a camera, that of the reference unless it has its own."""
    if fields.camera is not None and (own := read_lens(rig_file.parent / fields.camera, source)) is not None:
        return own
    if (reference.width, reference.height) != (source.width, source.height):
        raise CalibrationError(
            f"camera {fields.name} has no calibration, and pictures of {source.width} x {source.height}",
            file=rig_file,
            place="key cameras",
            expected=f"{reference.width} x {reference.height}, as the calibration of the reference camera",
            remedy="calibrate it alone, and name the file there: camera: FILE",
        )
    return reference
