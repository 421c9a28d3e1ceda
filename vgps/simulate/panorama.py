"""Pictures wider than a plane: the whole sphere, or a circular fisheye, put together from faces of a cube."""

from dataclasses import replace
from functools import cached_property

import cv2
import numpy as np

from vgps.model import FloatArray
from vgps.simulate.motion import Motion, MountedMotion
from vgps.simulate.render import Picture, Renderer
from vgps.simulate.scene import SceneConfig
from vgps.simulate.world import World

SPHERE_DEG = 360.0
_FACE_F = 1.05  # focal length of a face over pixels per radian of the picture: none of its detail is lost
_MARGIN_PX = 4  # of a face around its quarter of a turn
_FACES = np.array(  # rows: z of each face, and its x; y completes them
    [
        [[0, 0, 1], [1, 0, 0]],
        [[1, 0, 0], [0, 0, -1]],
        [[0, 0, -1], [-1, 0, 0]],
        [[-1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0]],
        [[0, 1, 0], [1, 0, 0]],
    ],
    float,
)


class PanoramaRenderer:
    """Renders frames of ``panorama_deg``: each face of a cube as a pinhole sees it, then each pixel's ray."""

    def __init__(self, world: World, motion: Motion, config: SceneConfig, seed: int = 0) -> None:
        self._config, self._seed = config, seed
        half = int(np.ceil(_FACE_F * pixels_per_radian(config))) + _MARGIN_PX
        self._focal, self._middle = _FACE_F * pixels_per_radian(config), half - 0.5
        face = replace(
            config, width=2 * half, height=2 * half, focal_px=self._focal, noise_levels=0.0, panorama_deg=0.0
        )
        self._faces = {
            k: Renderer(world, MountedMotion(motion, _pose(k)), face, seed)
            for k in np.unique(self._face[self._seen]).tolist()
        }

    def frame(self, index: int) -> Picture:
        """Render a frame, with the sensor's noise; black where the lens sees nothing."""
        config = self._config
        picture = np.zeros((config.height, config.width, 3), np.uint8)
        for k, renderer in self._faces.items():
            here = self._seen & (self._face == k)
            camera_p = self._rays[here] @ _pose(k)[:3, :3]
            uv = np.zeros((config.height, config.width, 2), np.float32)
            uv[here] = camera_p[:, :2] / camera_p[:, 2:] * self._focal + self._middle
            drawn = cv2.remap(renderer.frame(index), uv[..., 0], uv[..., 1], cv2.INTER_CUBIC)
            picture[here] = drawn[here]
        rng = np.random.default_rng([self._seed, 7, index])
        grain = config.noise_levels * rng.standard_normal(self._seen.shape, dtype=np.float32)
        noisy = np.clip(np.rint(picture + grain[..., None]), 0, 255).astype(np.uint8)
        return np.where(self._seen[..., None], noisy, np.uint8(0))

    @cached_property
    def _rays(self) -> FloatArray:
        """(H, W, 3) directions of the pixels."""
        config = self._config
        u, v = np.meshgrid(np.arange(float(config.width)), np.arange(float(config.height)))
        u, v = u - (config.width - 1) / 2, v - (config.height - 1) / 2
        if config.panorama_deg == SPHERE_DEG:
            longitude, latitude = 2 * np.pi * u / config.width, np.pi * v / config.height
            x, z = np.sin(longitude) * np.cos(latitude), np.cos(longitude) * np.cos(latitude)
            return np.stack([x, np.sin(latitude), z], axis=-1)
        radius = np.maximum(np.hypot(u, v), 1e-9)
        theta = radius / pixels_per_radian(config)
        return np.stack([u / radius * np.sin(theta), v / radius * np.sin(theta), np.cos(theta)], axis=-1)

    @cached_property
    def _seen(self) -> np.ndarray:
        if self._config.panorama_deg == SPHERE_DEG:
            return np.ones(self._rays.shape[:2], bool)
        return np.asarray(self._rays[..., 2] >= np.cos(np.radians(self._config.panorama_deg / 2)))

    @cached_property
    def _face(self) -> np.ndarray:
        """(H, W) the face of each pixel's ray."""
        return np.asarray((self._rays @ _FACES[:, 0].T).argmax(axis=-1))


def pixels_per_radian(config: SceneConfig) -> float:
    """Return the scale of the picture: its circle fills the shorter side, the sphere the width."""
    across = config.width if config.panorama_deg == SPHERE_DEG else min(config.width, config.height)
    return float(across / np.radians(config.panorama_deg))


def _pose(face: int) -> FloatArray:
    """Return camera_T_face (4, 4)."""
    z, x = _FACES[face]
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    return pose
