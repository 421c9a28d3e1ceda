"""Poses as they come, in a window: video, path, fixes, standard deviations and messages."""

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from scipy.spatial.transform import Rotation

from vgps.model import FixClass, FloatArray, GrayImage
from vgps.solution import Verdict
from vgps.viewer import colours
from vgps.viewer.plots import AXES
from vgps.viewer.rerun_recording import opened_window
from vgps.viewer.run_stream import TIME
from vgps.viewer.scene import CAMERA, FIXES, IMAGE, PATH, WORLD

SIGMA, LATENCY, MESSAGES = "sigma", "latency", "messages"
_PICTURE_S = 0.1  # between pictures, which are most of the data
_PICTURE_WIDTH = 640
_AXIS_M = 2.0
_REMEDY = "leave --rerun out, and show the run folder of --out with vgps inspect"


class LiveView:
    """A view of poses as they come.

    Args:
        stream: A window or a file.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._last: FloatArray | None = None
        self._picture_s = -np.inf
        stream.send_blueprint(_blueprint())
        stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for axis, colour in AXES:
            stream.log(f"{SIGMA}/{axis}", rr.SeriesLines(names=axis, colors=colour), static=True)

    def pose(self, t_s: float, world_T_camera: FloatArray, sigma_m: FloatArray) -> None:
        """Show a pose (4, 4) and the standard deviations (3,) of its position; NaN without one."""
        centre, last = world_T_camera[:3, 3], self._last
        if not np.isfinite(centre).all():
            self._last = None
            return
        self._stream.set_time(TIME, duration=t_s)
        quaternion = Rotation.from_matrix(world_T_camera[:3, :3]).as_quat()
        self._stream.log(
            CAMERA,
            rr.Transform3D(translation=centre, quaternion=rr.Quaternion(xyzw=quaternion)),
            rr.TransformAxes3D(axis_length=_AXIS_M),
        )
        if last is not None:
            strip = rr.LineStrips3D(
                [np.stack([last, centre])], colors=[colours.PATH], radii=rr.Radius.ui_points(2.0)
            )
            self._stream.log(PATH, strip)
        for (axis, _), sigma in zip(AXES, sigma_m.tolist(), strict=True):
            if np.isfinite(sigma):
                self._stream.log(f"{SIGMA}/{axis}", rr.Scalars(sigma))
        self._last = centre.copy()

    def fix(self, t_s: float, position_m: FloatArray, fix_class: FixClass, verdict: Verdict) -> None:
        """Show a fix, its position (3,) and the verdict on it."""
        self._stream.set_time(TIME, duration=t_s)
        points = rr.Points3D(
            [position_m],
            colors=[colours.of_fix(fix_class, verdict)],
            radii=rr.Radius.ui_points(4.0),
            labels=[f"{fix_class}, {verdict}"],
            show_labels=False,
        )
        self._stream.log(FIXES, points)

    def latency(self, t_s: float, seconds: float) -> None:
        """Show the time from the arrival of a frame to its pose."""
        self._stream.set_time(TIME, duration=t_s)
        self._stream.log(LATENCY, rr.Scalars(1e3 * seconds))

    def message(self, t_s: float, text: str) -> None:
        """Show a message."""
        self._stream.set_time(TIME, duration=t_s)
        self._stream.log(MESSAGES, rr.TextLog(text))

    def image(self, t_s: float, gray: GrayImage) -> None:
        """Show a frame (H, W); most are left out."""
        if t_s - self._picture_s < _PICTURE_S:
            return
        self._picture_s = t_s
        size = (_PICTURE_WIDTH, round(gray.shape[0] * _PICTURE_WIDTH / gray.shape[1]))
        small = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
        self._stream.set_time(TIME, duration=t_s)
        self._stream.log(IMAGE, rr.Image(small).compress(jpeg_quality=80))

    def close(self) -> None:
        """Send what is left."""
        self._stream.flush()


def live_window() -> LiveView:
    """Open a window.

    Raises:
        ViewerError: There is no display, or the viewer does not start.
    """
    return LiveView(opened_window(_REMEDY))


def _blueprint() -> rrb.Blueprint:
    """Return the layout: what has come so far stays in the scene."""
    so_far = rrb.VisibleTimeRanges(
        timeline=TIME,
        start=rr.TimeRangeBoundary.infinite(),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )
    scene = rrb.Spatial3DView(
        origin=WORLD,
        contents=["+ $origin/**", f"- /{IMAGE}"],
        name="Scene, ENU metres",
        overrides={PATH: so_far, FIXES: so_far},
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial2DView(origin=IMAGE, name="Video"),
                rrb.TimeSeriesView(origin=SIGMA, name="Std. dev. [m]"),
                rrb.TimeSeriesView(origin=LATENCY, name="Frame to pose [ms]"),
            ),
            rrb.Vertical(scene, rrb.TextLogView(origin=MESSAGES, name="Messages"), row_shares=[3, 1]),
            column_shares=[2, 3],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="following"),
    )
