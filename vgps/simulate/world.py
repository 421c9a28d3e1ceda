"""Worlds of textured parallelograms, some of them moving."""

from dataclasses import dataclass, field

import numpy as np

from vgps.model import BoolArray, FloatArray, IntArray
from vgps.simulate.textures import Image

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class World:
    """Textured parallelograms: texture coordinates (a, b) in [0, 1] are at ``origin + a edge_u + b edge_v``.

    Attributes:
        origin, edge_u, edge_v: (Q, 3) ENU metres; u is right and v down in the texture.
        texture: (Q,) row of ``textures``.
        repeat: (Q,) number of tiles along each edge; above one for endless surfaces.
        two_sided: (Q,) whether it is visible from behind.
        velocity: (Q, 3) m/s.
        epoch_s: (Q,) time at which each parallelogram is at its origin.
        textures: Images of the textures.
    """

    origin: FloatArray
    edge_u: FloatArray
    edge_v: FloatArray
    texture: IntArray
    repeat: IntArray
    two_sided: BoolArray
    velocity: FloatArray
    epoch_s: FloatArray
    textures: tuple[Image, ...]

    def origins(self, t_s: float) -> FloatArray:
        """Return (Q, 3) origins at a time."""
        return self.origin + (t_s - self.epoch_s)[:, None] * self.velocity


@dataclass
class Builder:
    """Collects parallelograms for a :class:`World`."""

    images: list[Image] = field(default_factory=list)
    rows: list[tuple[FloatArray, FloatArray, FloatArray, int, int, bool, FloatArray, float]] = field(
        default_factory=list
    )
    velocity: FloatArray = field(default_factory=lambda: np.zeros(3))
    epoch_s: float = 0.0

    def image(self, image: Image) -> int:
        """Add a texture and return its row."""
        self.images.append(image)
        return len(self.images) - 1

    def add(
        self,
        origin: FloatArray,
        u: FloatArray,
        v: FloatArray,
        texture: int,
        two_sided: bool = False,
        repeat: int = 1,
    ) -> None:
        """Add a parallelogram."""
        self.rows.append((origin, u, v, texture, repeat, two_sided, self.velocity, self.epoch_s))

    def flat(
        self, center: FloatArray, heading: float, length: float, width: float, texture: int, repeat: int = 1
    ) -> None:
        """Add a level rectangle; the right of its texture points along the heading."""
        along, left = axes(heading)
        self.add(
            center - along * length / 2 + left * width / 2,
            along * length,
            -left * width,
            texture,
            True,
            repeat,
        )

    def upright(
        self, foot: FloatArray, facing: FloatArray, width: float, height: float, texture: int
    ) -> None:
        """Add a vertical rectangle above the middle of its foot, visible from the side that it faces."""
        right = np.cross(UP, facing)
        self.add(foot - right * width / 2 + UP * height, right * width, -UP * height, texture)

    def billboard(self, foot: FloatArray, heading: float, width: float, height: float, texture: int) -> None:
        """Add two crossed vertical rectangles, visible from all sides."""
        for direction in axes(heading):
            self.add(
                foot - direction * width / 2 + UP * height,
                direction * width,
                -UP * height,
                texture,
                two_sided=True,
            )

    def box(
        self,
        foot: FloatArray,
        heading: float,
        size: tuple[float, float, float],
        side: int,
        end: int,
        top: int,
    ) -> None:
        """Add a box of (length, width, height) above the middle of its foot, its length along the heading."""
        along, left = axes(heading)
        for axis, half, across, texture in ((left, size[1], size[0], side), (along, size[0], size[1], end)):
            for sign in (1.0, -1.0):
                self.upright(foot + sign * axis * half / 2, sign * axis, across, size[2], texture)
        self.flat(foot + UP * size[2], heading, size[0], size[1], top)

    def world(self) -> World:
        """Return the world with all that was added."""
        origin, u, v, texture, repeat, two_sided, velocity, epoch = zip(*self.rows, strict=True)
        return World(
            origin=np.array(origin, float),
            edge_u=np.array(u, float),
            edge_v=np.array(v, float),
            texture=np.array(texture),
            repeat=np.array(repeat),
            two_sided=np.array(two_sided),
            velocity=np.array(velocity, float),
            epoch_s=np.array(epoch, float),
            textures=tuple(self.images),
        )


def axes(heading: float) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors along and to the left of a heading."""
    c, s = np.cos(heading), np.sin(heading)
    return np.array([c, s, 0.0]), np.array([-s, c, 0.0])
