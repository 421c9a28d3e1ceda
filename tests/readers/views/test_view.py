from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from vgps.model import Camera, Frame
from vgps.readers.views.lenses import Equirectangular, wide_fisheye
from vgps.readers.views.view import FACE_DEG, View, ViewMasks, ViewVideo, views_of

SPHERE = Equirectangular(400, 200)
F = 100.0 / np.radians(195 / 2)
FISHEYE = wide_fisheye(
    Camera(model="fisheye", width=201, height=201, fx=F, fy=F, cx=100.0, cy=100.0, distortion=(0.0,) * 4)
)
assert FISHEYE is not None


def rays_of(view: View) -> np.ndarray:
    """(H, W, 3) unit rays of a view's pixels in the axes of the lens."""
    camera = view.camera
    v, u = np.mgrid[: camera.height, : camera.width].astype(float)
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ view.lens_R_view.T


def test_a_view_shows_each_ray_s_place_of_the_picture():
    """The picture's grey values are a smooth function of direction, which every view must show."""
    v, u = np.mgrid[:200, :400].astype(float)
    longitude, latitude = (u - 199.5) * 2 * np.pi / 400, (v - 99.5) * np.pi / 200
    x, y, z = np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)
    for axis, component in enumerate((x, y, z)):
        picture = np.round(127.5 + 120 * component).astype(np.uint8)
        for view in views_of(Equirectangular(400, 200, ("front", "right", "rear", "left", "up", "down"))):
            expected = 127.5 + 120 * rays_of(view)[..., axis]
            assert np.abs(view.picture(picture) - expected).max() < 2.5, view.name


def test_the_rotations_are_rotations_and_the_first_is_the_lens_s():
    views = views_of(FISHEYE)
    for view in views:
        np.testing.assert_allclose(view.lens_R_view.T @ view.lens_R_view, np.eye(3))
        assert np.linalg.det(view.lens_R_view) == pytest.approx(1.0)
    np.testing.assert_array_equal(views[0].lens_R_view, np.eye(3))


def test_the_views_of_the_sphere_overlap_all_around():
    views = views_of(SPHERE)
    assert [view.name for view in views] == ["front", "right", "rear", "left"]
    for view in views:
        left, right = rays_of(view)[view.camera.height // 2, [0, -1]]
        assert np.degrees(np.arccos(left @ right)) == pytest.approx(FACE_DEG, abs=1.0)
        assert view.camera.fx == pytest.approx(400 / (2 * np.pi))
        assert view.seen.all()


def test_a_fisheye_s_views_are_cut_to_its_circle():
    front, right, left, up, down = views_of(FISHEYE)
    assert front.seen.all()
    for view in (right, left):
        assert view.camera.width < 0.7 * front.camera.width and view.camera.height == front.camera.height
        assert view.seen.any(axis=0).all() and view.seen.any(axis=1).all()
    for view in (up, down):
        assert view.camera.height < 0.7 * front.camera.height
    angles = np.degrees(np.arccos(rays_of(right)[right.seen][:, 2]))
    assert 97.0 < angles.max() < 98.0


class TwoFrames:
    path, times_s, width, height = Path("video.mp4"), np.array([0.0, 0.1]), 201, 201
    warnings = ("damaged",)

    def frames(self) -> Iterator[Frame]:
        for k in range(2):
            yield Frame(k, 0.1 * k, np.full((201, 201), 100 + k, np.uint8))

    def pictures(self, wanted):
        return ((k, np.full((201, 201, 3), 100 + k, np.uint8)) for k in wanted)


def test_the_video_of_a_view_has_its_size_and_is_black_where_the_lens_does_not_see():
    right = views_of(FISHEYE)[1]
    video = ViewVideo(TwoFrames(), right)
    second = list(video.frames())[1]
    assert (video.width, video.height) == second.gray.shape[::-1] == (right.camera.width, right.camera.height)
    assert second.t_s == 0.1 and (second.gray[right.seen] == 101).all() and not second.gray[~right.seen].any()
    ((index, colours),) = video.pictures([1])
    assert index == 1 and colours.shape == (*second.gray.shape, 3) and (colours[right.seen] == 101).all()
    assert video.warnings == () and ViewVideo(TwoFrames(), views_of(FISHEYE)[0]).warnings == ("damaged",)


class LowerHalf:
    files = (Path("masks/video.mp4.png"),)

    def of_frame(self, index):
        mask = np.ones((201, 201), bool)
        mask[101:] = False
        return mask if index == 0 else None


def test_masks_are_those_of_the_wide_picture_and_of_the_lens():
    front, right = views_of(FISHEYE)[:2]
    masks = ViewMasks(right, LowerHalf())
    shown = masks.of_frame(0)
    upper = rays_of(right)[..., 1] < -0.05
    np.testing.assert_array_equal(shown[upper], right.seen[upper])
    assert not shown[rays_of(right)[..., 1] > 0.05].any()
    np.testing.assert_array_equal(masks.of_frame(1), right.seen)
    assert masks.files == LowerHalf.files
    assert ViewMasks(front, None).of_frame(0) is None and ViewMasks(front, None).files == ()
