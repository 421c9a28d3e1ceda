"""A textured room seen by a moving camera: images, exact poses, and the exact point behind every pixel.

The world is east, north, up in metres; the camera starts looking north. The room is convex, so nothing in
view is hidden.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation
from solutions import NORTH_R_CAMERA, make_gps_log, make_poses

from factors import poses_at
from vgps.camera import distort, row_shares, undistort
from vgps.config import Config, MappingConfig, TrackingConfig, WindowConfig
from vgps.geodesy import to_geodetic
from vgps.geometry import project
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFeatures, NewFrame, NewView, Positions
from vgps.model import Camera, ControlPoints, FixClass, Frame, GeodeticPoint, Recording, Rig
from vgps.tracking.corners import new_corners

CAMERA = Camera(model="pinhole", width=320, height=240, fx=260.0, fy=255.0, cx=158.0, cy=121.0)
LENS = replace(CAMERA, model="opencv", distortion=(-0.15, 0.04, 0.001, -0.001))
CONFIG = Config(
    tracking=TrackingConfig(max_features=150),
    mapping=MappingConfig(max_track_frames=20),
    window=WindowConfig(length_frames=12, every_frames=5, delay_frames=0),
)
FPS = 10.0
ROOM_ORIGIN = GeodeticPoint(49.0, 8.4, 160.0)
FACES = ((0, -4.0), (0, 4.0), (1, -9.0), (1, 13.0), (2, -2.5), (2, 2.5))  # an axis, and where the room ends
TEXEL_M, TEXELS, MIDDLE = 0.05, 512, 200


def path(frames):
    """(F, 4, 4) 12 cm to the north-east a frame, weaving, with turns of some degrees."""
    t = np.arange(frames)
    turn = np.column_stack([4 * np.sin(t / 6), 1.5 * np.sin(t / 4), np.sin(t / 5)])
    positions = np.column_stack([0.1 * t - 1.0, 0.06 * t, 0.15 * np.sin(t / 4)])
    return make_poses(positions, NORTH_R_CAMERA @ Rotation.from_euler("yxz", turn, degrees=True).as_matrix())


def moved(pose, right_m=0.0, turn_deg=(0.0, 0.0, 0.0)):
    """The pose of a camera that moved to its right and turned about its own axes x, y, z."""
    out = pose.copy()
    out[:3, 3] += right_m * pose[:3, 0]
    out[:3, :3] = pose[:3, :3] @ Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    return out


@cache
def textures(seed):
    """(6 H, W) the faces' textures below each other: blobs of 10 cm and of half a metre."""
    rng = np.random.default_rng(seed)
    shape = (len(FACES) * TEXELS, TEXELS)
    layers = sum(cv2.GaussianBlur(rng.normal(size=shape), (0, 0), sigma) * sigma for sigma in (2.0, 10.0))
    return np.clip(128 + 45 * layers / layers.std(), 0, 255).astype(np.float32)


@cache
def pixel_rays(camera):
    """(H W, 3) camera ray of every pixel of the distorted image."""
    v, u = np.mgrid[: camera.height, : camera.width]
    return rays(undistort(camera, np.column_stack([u.ravel(), v.ravel()]).astype(float)))


def rays(uv):
    """(n, 3) camera rays through undistorted pixels."""
    return np.column_stack([(uv - (CAMERA.cx, CAMERA.cy)) / (CAMERA.fx, CAMERA.fy), np.ones(len(uv))])


def walls(pose, camera_rays):
    """Where rays from a camera end (n, 3), and on which face (n,)."""
    direction, centre = camera_rays @ pose[:3, :3].T, pose[:3, 3]
    with np.errstate(divide="ignore"):
        distance = np.stack([(end - centre[axis]) / direction[:, axis] for axis, end in FACES])
    distance[distance <= 0] = np.inf
    face = distance.argmin(axis=0)
    return centre + distance.min(axis=0)[:, None] * direction, face


def points_at(pose, uv):
    """(n, 3) exact points that a camera sees at undistorted pixels (n, 2)."""
    return walls(pose, rays(uv))[0]


def pixels(pose, points):
    """(n, 2) exact undistorted pixels of points (n, 3)."""
    return project(CAMERA.K, pose, points)[0]


def image(pose, camera=CAMERA, seed=0):
    """What the camera's lens shows of the room, uint8."""
    points, face = walls(pose, pixel_rays(camera))
    axis = np.array([axis for axis, _ in FACES])[face]
    u, v = np.where(axis == 0, points[:, 1], points[:, 0]), np.where(axis == 2, points[:, 1], points[:, 2])
    texel = np.column_stack([u, v]) / TEXEL_M + MIDDLE
    texel[:, 1] += face * TEXELS
    texel = texel.astype(np.float32).reshape(camera.height, camera.width, 2)
    return np.round(cv2.remap(textures(seed), texel, None, cv2.INTER_LINEAR)).astype(np.uint8)


@cache
def images(count):
    """The images along the path, made once."""
    return tuple(image(pose) for pose in path(count))


def frames(poses, black=(), start=0):
    """Frames of these poses, 10 a second from frame ``start`` on; those in ``black`` show nothing."""
    for index, pose in enumerate(poses, start=start):
        gray = np.zeros((CAMERA.height, CAMERA.width), np.uint8) if index in black else image(pose)
        yield Frame(index, index / FPS, gray)


class RoomVideo:
    """A recording's video of the room."""

    path, width, height = Path("room.mp4"), CAMERA.width, CAMERA.height

    def __init__(self, poses):
        self._poses, self.times_s = poses, np.arange(len(poses)) / FPS

    def frames(self):
        return frames(self._poses)


def room_recording(poses, **parts):
    """A recording of the room by a camera whose antenna is its centre."""
    rig = Rig(world_origin=ROOM_ORIGIN)
    return Recording(path=Path("room"), video=RoomVideo(poses), camera=CAMERA, rig=rig, **parts)


def room_gps_log(poses):
    """Exact RTK fixes of every third frame."""
    t_s = np.arange(0, len(poses), 3) / FPS
    latitude, longitude, height = to_geodetic(ROOM_ORIGIN, poses[::3, :3, 3]).T
    log = make_gps_log(t_s, (FixClass.RTK_FIX,) * len(t_s))
    return replace(log, latitude_deg=latitude, longitude_deg=longitude, height_m=height)


def room_control_points(poses, geodetic):
    """Six points of the room in the frames 2 and 12."""
    uv = np.random.default_rng(0).uniform((40, 40), (280, 200), (6, 2))
    points = points_at(poses[7], uv)
    return ControlPoints(
        name=("a", "b", "c", "d", "e", "f") * 2,
        sigma_m=np.zeros((12, 3)),
        check=np.zeros(12, bool),
        frame=np.repeat([2, 12], 6),
        uv_px=np.concatenate([pixels(poses[k], points) for k in (2, 12)]),
        world_p_point=np.tile(to_geodetic(ROOM_ORIGIN, points) if geodetic else points, (2, 1)),
        geodetic=geodetic,
        source=Path("control_points.csv"),
    )


def followed_map(poses, camera=CAMERA, positions=True, count=120):
    """A map of features that start in its first frame and are observed exactly in all, and their points.

    Args:
        poses: (F, 4, 4) of the map's frames; its poses if it has positions, else unknown.
        camera: Its lens.
        positions: Whether the map has poses and positions, exact ones.
        count: Corners of the first image.
    """
    raw = new_corners(
        image(poses[0], camera), np.zeros((0, 2)), count, CONFIG.tracking, np.random.default_rng(1)
    )
    points = points_at(poses[0], undistort(camera, raw))
    in_view = np.ones(len(points), dtype=bool)
    for pose in poses:
        at = distort(camera, pixels(pose, points))
        in_view &= np.all((at > 15) & (at < (camera.width - 15, camera.height - 15)), axis=1)
    points = points[in_view]
    made = LocalMap(0, CONFIG.mapping.max_track_frames)
    for index, pose in enumerate(poses):
        uv = pixels(pose, points)
        raw = distort(camera, uv)
        frame = NewFrame(index / FPS, pose if positions else np.full((4, 4), np.nan))
        view = NewView(index, raw[: len(made.ids)], uv[: len(made.ids)], np.ones(len(made.ids), dtype=bool))
        made.apply(MapUpdate(frames=(frame,), view=view))
        if index == 0:
            gray = np.zeros(len(points), dtype=np.uint8)
            made.apply(MapUpdate(features=NewFeatures(raw, uv, gray)))
    if positions:
        made.apply(MapUpdate(positions=Positions(made.ids, points, np.full(len(points), 0.3))))
    return made, points


def distance_m(a, b):
    """Distance between two poses."""
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))


def roll_shutter(local_map, points, poses, camera):
    """Let a rolling shutter observe the points (N, 3) of a map in all its frames, each posed in poses."""
    for view, frame in enumerate(range(len(poses)), start=local_map.views.shape[1] - len(poses)):
        uv = local_map.views[:, view].copy()
        for _ in range(30):  # the row depends on the pose, and the pose on the row
            share = row_shares(camera, uv)
            at_s = local_map.t_s[frame] + camera.readout_s * share
            rows = poses_at(local_map.t_s, poses, at_s, frame - (share < 0))
            uv = np.stack([pixels(pose, point[None])[0] for pose, point in zip(rows, points, strict=True)])
        local_map.views[:, view] = uv
