"""Checkered boards, motions at constant rates, and where a camera sees their corners."""

import numpy as np
from scipy.interpolate import CubicSpline

from vgps.simulate import Builder, Motion, Renderer, SceneConfig

CONFIG = SceneConfig(
    speed=((0.0, 0.0), (2.0, 0.0)), bends=(), width=320, height=240, focal_px=300.0, noise_levels=0.0, fps=10
)


WEST = np.array([-1.0, 0.0, 0.0])


FRONT = np.array([6.0, 0.0, -1.0])  # foot of what stands before a camera at the origin that looks east


def moving(rates=(0.0,) * 6, start=(0.0,) * 6) -> Motion:
    """East, north, up, yaw, pitch, roll at constant rates."""
    t = np.linspace(-2.0, 4.0, 13)
    return Motion(CubicSpline(t, np.array(start) + t[:, None] * np.array(rates)))


def plain(color: tuple[int, int, int]) -> np.ndarray:
    return np.full((64, 64, 4), (*color, 255), np.uint8)


def checkers(squares: int, size: int) -> np.ndarray:
    board = np.kron(np.indices((squares, squares)).sum(axis=0) % 2, np.ones((size // squares,) * 2))
    image = np.full((*board.shape, 4), 255, np.uint8)
    image[..., :3] = np.where(board[..., None] > 0, 210, 40)
    return image


def project(renderer: Renderer, world_T_camera: np.ndarray, points: np.ndarray) -> np.ndarray:
    seen = (points - world_T_camera[:3, 3]) @ world_T_camera[:3, :3] @ renderer.K.T
    return seen[:, :2] / seen[:, 2:]


def board_and_corners(squares: int = 8, size: int = 512, repeat: int = 1):
    builder = Builder()
    texture = builder.image(checkers(squares, size))
    builder.add(
        FRONT + np.array([0, 1.0, 2.0]),
        np.array([0, -2.0, 0]),
        np.array([0, 0, -2.0]),
        texture,
        repeat=repeat,
    )
    inner = np.arange(1, squares * repeat) / (squares * repeat)
    a, b = np.meshgrid(inner, inner)
    corners = np.stack([np.full(a.size, 6.0), 1.0 - 2.0 * a.ravel(), 1.0 - 2.0 * b.ravel()], axis=-1)
    return builder.world(), corners
