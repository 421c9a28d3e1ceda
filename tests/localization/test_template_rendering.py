import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from textured_wall import CAMERA, picture, pose_at, views_from

from vgps.geometry import project
from vgps.localization.template_rendering import plane_to_image, render_templates

POSE = pose_at(0.3)
VIEWS = views_from(POSE, 40)
STILL = np.zeros((len(VIEWS), 2))


def patches(image, uv, side):
    """The image around pixels, by whole pixels."""
    half = side // 2
    at = np.round(uv).astype(int)
    return np.array([image[v - half : v + half + 1, u - half : u + half + 1] for u, v in at])


def similarity(a, b):
    a, b = (x.reshape(len(x), -1) - x.mean(axis=(1, 2))[:, None] for x in (a, b))
    return (a * b).sum(axis=1) / np.sqrt((a**2).sum(axis=1) * (b**2).sum(axis=1))


def test_from_the_place_of_the_view_a_template_is_unchanged():
    out = render_templates(CAMERA.K, POSE, VIEWS, STILL, 15)
    np.testing.assert_allclose(out, VIEWS.templates[:, 0], atol=1e-2)


def test_surroundings_of_a_level_come_from_the_next():
    image = picture(POSE)
    uv, _ = project(CAMERA.K, POSE, VIEWS.world_p_landmark)
    out = render_templates(CAMERA.K, POSE, VIEWS, STILL, 31)
    np.testing.assert_allclose(out[:, 8:23, 8:23], VIEWS.templates[:, 0], atol=1e-2)
    assert np.median(similarity(out, patches(image, uv, 31))) > 0.9


@pytest.mark.parametrize(
    ("rotation_deg", "moved_m"),
    [
        ((0, 0, 25), (0, 0, 0)),
        ((3, -8, 10), (0.5, 0.2, 1.0)),
        ((0, 12, 0), (-2, 0, -4.0)),
        ((0, 0, 0), (0, 0, 4.0)),
    ],
)
def test_from_another_place_a_template_looks_like_the_image(rotation_deg, moved_m):
    pose = POSE.copy()
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_euler("xyz", rotation_deg, degrees=True).as_matrix()
    pose[:3, 3] += moved_m
    uv, _ = project(CAMERA.K, pose, VIEWS.world_p_landmark)
    inside = ((uv > 20) & (uv < (299, 219))).all(axis=1)
    assert inside.sum() >= 5
    out = render_templates(CAMERA.K, pose, VIEWS, STILL, 15)[inside]
    assert np.median(similarity(out, patches(picture(pose), uv[inside], 15))) > 0.88


def test_the_affine_map_is_the_derivative_of_the_projection():
    pose = POSE.copy()
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_euler("xyz", (0.1, -0.2, 0.3)).as_matrix()
    pose[:3, 3] += (0.4, 0.1, 0.8)
    found = plane_to_image(CAMERA.K, pose, VIEWS)
    step = 1e-4
    for axis, vector in enumerate((VIEWS.world_v_column, VIEWS.world_v_row)):
        ahead, _ = project(CAMERA.K, pose, VIEWS.world_p_landmark + step * vector)
        behind, _ = project(CAMERA.K, pose, VIEWS.world_p_landmark - step * vector)
        np.testing.assert_allclose(found[:, :, axis], (ahead - behind) / (2 * step), atol=1e-6)


def test_at_the_place_of_the_view_a_template_pixel_is_an_image_pixel():
    np.testing.assert_allclose(
        plane_to_image(CAMERA.K, POSE, VIEWS), np.tile(np.eye(2), (len(VIEWS), 1, 1)), atol=1e-9
    )
