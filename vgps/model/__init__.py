"""Data exchanged between packages: frozen dataclasses of NumPy arrays, with units in their names.

Frames: ``world`` is local ENU at ``world_origin``; ``camera`` is OpenCV's (x right, y down, z forward);
``world_T_camera`` maps camera coordinates to world coordinates. Times are seconds since the video's first
frame.
"""

from vgps.model.arrays import BoolArray, Float32Array, FloatArray, GrayImage, IntArray, RgbImage
from vgps.model.camera import Camera, CameraGuess, FocalChanges, LensModel
from vgps.model.control_points import ControlPoints
from vgps.model.gps import FixClass, GeodeticPoint, GpsLog
from vgps.model.inertial import GyroLog, ImuLog
from vgps.model.recording import Recording
from vgps.model.rig import ImuMount, Rig, RigCamera
from vgps.model.video import Frame, Masks, Video

__all__ = [
    "BoolArray",
    "Camera",
    "CameraGuess",
    "ControlPoints",
    "FixClass",
    "Float32Array",
    "FloatArray",
    "FocalChanges",
    "Frame",
    "GeodeticPoint",
    "GpsLog",
    "GrayImage",
    "GyroLog",
    "ImuLog",
    "ImuMount",
    "IntArray",
    "LensModel",
    "Masks",
    "Recording",
    "RgbImage",
    "Rig",
    "RigCamera",
    "Video",
]
