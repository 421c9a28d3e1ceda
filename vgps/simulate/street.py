"""Surroundings of a scene: a street along its path, where it comes for the first time."""

import math
from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from vgps.model import FloatArray
from vgps.simulate import textures
from vgps.simulate.motion import center_line
from vgps.simulate.scene import SceneConfig
from vgps.simulate.world import UP, Builder, World, axes

_TILE_M = 20.0
_STYLES = 6
_STREET_M = 8.0  # a path that comes back this close is in the street where it was
_COMES_BACK_M = 40.0  # along the path; nearer parts of it are the same visit


def build_world(config: SceneConfig, rng: np.random.Generator) -> World:
    """Build a street along the scene's path: ground, houses, trees, cars, signs, a skyline and the sky."""
    builder = Builder()
    line = center_line(config, 45.0, 90.0)
    _add_backdrop(builder, config, rng, line)
    _add_ground(builder, config, rng, line)
    _add_houses(builder, config, rng, line)
    _add_furniture(builder, config, rng, line)
    if config.moving:
        _add_traffic(builder, config, rng, line)
    return builder.world()


def _add_backdrop(builder: Builder, config: SceneConfig, rng: np.random.Generator, line: FloatArray) -> None:
    center = np.append(line[:, 1:3].mean(axis=0), 0.0)
    px = _texture_size(config)
    builder.flat(center + 400 * UP, 0.0, 9000.0, 9000.0, builder.image(textures.sky(rng, px(1024))))
    radius = 230.0 + np.ptp(line[:, 1:3], axis=0).max() / 2
    ring = [builder.image(textures.skyline(rng, px(192), px(1024))) for _ in range(3)]
    for k, angle in enumerate(np.arange(10) * 2 * np.pi / 10):
        outward = axes(angle)[0]
        builder.upright(
            center + radius * outward, -outward, 2 * radius * np.tan(np.pi / 10), 38.0, ring[k % 3]
        )


def _add_ground(builder: Builder, config: SceneConfig, rng: np.random.Generator, line: FloatArray) -> None:
    size = _texture_size(config)(2048)
    paved = config.surface == "paving"
    tile = builder.image(textures.paving(rng, size, 32) if paved else textures.asphalt(rng, size))
    reach = max(1000.0, np.ptp(line[:, 1:3], axis=0).max() / 2 + 500.0)
    extent = _TILE_M * 2 * math.ceil(reach / _TILE_M)
    builder.flat(
        np.append(line[:, 1:3].mean(axis=0), 0.0), 0.0, extent, extent, tile, round(extent / _TILE_M)
    )
    if not paved:
        paint = builder.image(np.full((8, 64, 4), (205, 210, 212, 255), np.uint8))
        for _, east, north, heading in _new_streets(line)[::6]:
            for side, length in ((1.75, 2.5), (-1.9, 5.0), (5.4, 5.0)):
                foot = np.array([east, north, 0.01]) + side * axes(heading)[1]
                builder.flat(foot, heading, length, 0.14, paint)


def _add_houses(builder: Builder, config: SceneConfig, rng: np.random.Generator, line: FloatArray) -> None:
    px = _texture_size(config)
    fronts = [builder.image(textures.facade(rng, px(832), px(1000), style)) for style in range(_STYLES)]
    roof = builder.image(np.full((16, 16, 4), (90, 90, 95, 255), np.uint8))
    rows = (
        (*config.setback_m, 8.0, (9.0, 13.0)),
        (config.setback_m[1] + 14, config.setback_m[1] + 24, 14.0, (14.0, 22.0)),
    )
    places, repeating = _new_streets(line), _Repetition(rng, config.look_alike_m)
    for side in (1.0, -1.0):
        for near, far, depth, heights in rows:
            k = repeating.begin()
            while k < len(places):
                _, east, north, heading = places[k]
                width = float(rng.choice([10.0, 12.0, 14.0]))
                size = (width, depth, rng.uniform(*heights))
                foot = (
                    np.array([east, north, 0.0])
                    + side * (rng.uniform(near, far) + depth / 2) * axes(heading)[1]
                )
                texture = fronts[rng.integers(_STYLES)]
                if _is_clear(line, foot, heading, size, near - 0.5):
                    builder.box(foot, heading, size, texture, fronts[rng.integers(_STYLES)], roof)
                k = repeating.advance(k + round(width + rng.choice([0.0, 0.5, 3.0])))
    _, east, north, heading = line[-1]  # a house ends the street
    foot, size = np.array([east, north, 0.0]), (12.0, 40.0, 14.0)
    if _is_clear(line[line[:, 0] < line[-1, 0] - _COMES_BACK_M], foot, heading, size, 0.0):
        builder.box(foot, heading, size, fronts[0], fronts[1], roof)


def _add_furniture(builder: Builder, config: SceneConfig, rng: np.random.Generator, line: FloatArray) -> None:
    """Add trees, parked cars, signs on poles and boxes between the path and the houses."""
    px = _texture_size(config)
    trees = [builder.image(textures.tree(rng, px(512))) for _ in range(2)]
    boards = [builder.image(textures.poster(rng, px(192), px(192))) for _ in range(4)]
    cars = [_car_images(builder, config, rng) for _ in range(3)]
    low, high = 0.42 * config.setback_m[0], config.setback_m[0] - 0.6
    places, repeating = _new_streets(line), _Repetition(rng, config.look_alike_m)
    k = repeating.begin(3) - 4
    while (k := repeating.advance(k + 4)) < len(places):
        _, east, north, heading = places[k]
        side = float(rng.choice([-1.0, 1.0]))
        foot = np.array([east, north, 0.0]) + side * rng.uniform(low, high) * axes(heading)[1]
        kind = rng.choice(["tree", "tree", "car", "sign", "sign", "box", "box"])
        size = {
            "tree": (0.6, 0.6, 5.0),
            "car": (4.2, 1.7, 1.4),
            "sign": (0.3, 0.3, 3.0),
            "box": (0.9, 0.7, 1.3),
        }[kind]
        if not _is_clear(line, foot, heading, size, low - 0.9):
            continue
        if kind == "tree":
            crown = rng.uniform(3.0, 5.0) if config.setback_m[0] > 6 else rng.uniform(1.8, 2.6)
            builder.billboard(foot, heading + 0.6, crown, rng.uniform(3.5, 6.0), trees[rng.integers(2)])
        elif kind == "car":
            _add_car(builder, foot, heading, cars[rng.integers(3)])
        elif kind == "sign":
            board = boards[rng.integers(4)]
            builder.box(foot, heading, (0.1, 0.1, 2.6), board, board, board)
            builder.box(foot + 2.0 * UP, heading, (0.08, 0.7, 0.7), board, board, board)
        else:
            builder.box(
                foot, heading, (0.9, 0.7, rng.uniform(0.9, 1.6)), *(boards[i] for i in rng.integers(0, 4, 3))
            )


def _add_traffic(builder: Builder, config: SceneConfig, rng: np.random.Generator, line: FloatArray) -> None:
    """Let a walker cross ahead and a car come from ahead, three times."""
    knots_t, knots_v = np.array(config.speed).T
    grid = np.linspace(0.0, knots_t[-1], 500)
    travelled = np.concatenate([[0.0], np.cumsum(np.interp(grid, knots_t, knots_v))[:-1] * grid[1]])
    car = _car_images(builder, config, rng)
    coat = builder.image(textures.poster(rng, 64, 32))
    for share in (0.25, 0.52, 0.8):
        builder.epoch_s = share * knots_t[-1]
        here = np.interp(builder.epoch_s, grid, travelled)
        _, east, north, heading = line[np.searchsorted(line[:, 0], here + 9.0)]
        along, left = axes(heading)
        builder.velocity = 1.3 * left
        builder.box(np.array([east, north, 0.0]), heading, (0.35, 0.5, 1.7), coat, coat, coat)
        _, east, north, heading = line[np.searchsorted(line[:, 0], here + 22.0)]
        along, left = axes(heading)
        builder.velocity = -4.0 * along
        _add_car(builder, np.array([east, north, 0.0]) + 0.55 * config.setback_m[0] * left, heading, car)


def _car_images(builder: Builder, config: SceneConfig, rng: np.random.Generator) -> tuple[int, int, int]:
    px = _texture_size(config)
    body = textures.car_side(rng, px(128), px(512), glass=False)
    return (
        builder.image(body),
        builder.image(textures.car_side(rng, px(96), px(320), glass=True)),
        builder.image(body[: body.shape[0] // 5, : body.shape[1] // 6].copy()),
    )


def _add_car(builder: Builder, foot: FloatArray, heading: float, images: tuple[int, int, int]) -> None:
    body, glass, paint = images
    builder.box(foot + 0.08 * UP, heading, (4.2, 1.7, 0.8), body, paint, paint)
    builder.box(foot + 0.88 * UP, heading, (2.3, 1.5, 0.55), glass, glass, paint)


class _Repetition:
    """Random choices along a path that begin again after a distance, so that streets look alike.

    Args:
        rng: The generator of the choices.
        every_m: The distance; 0 if they do not repeat.
    """

    def __init__(self, rng: np.random.Generator, every_m: float) -> None:
        self._rng, self._every = rng, round(every_m)

    def begin(self, metre: int = 0) -> int:
        """Begin at a metre of the path, and return it."""
        self._state = self._rng.bit_generator.state
        self._next = metre + self._every
        return metre

    def advance(self, metre: int) -> int:
        """Return the next metre, at which the choices begin again if the distance is over."""
        if not self._every or metre < self._next:
            return metre
        self._rng.bit_generator.state = self._state
        self._next += self._every
        return self._next - self._every


def _new_streets(line: FloatArray) -> FloatArray:
    """Return the rows of a path at which it is not in a street where it was before."""
    first = np.arange(len(line))
    pairs = cKDTree(line[:, 1:3]).query_pairs(_STREET_M, output_type="ndarray")
    np.minimum.at(first, pairs[:, 1], pairs[:, 0])
    return np.asarray(line[line[:, 0] - line[first, 0] < _COMES_BACK_M])


def _is_clear(
    line: FloatArray, foot: FloatArray, heading: float, size: tuple[float, float, float], clearance: float
) -> bool:
    """Whether a box is clear of the whole path."""
    along, left = axes(heading)
    offset = line[:, 1:3] - foot[:2]
    beside = np.abs(offset @ along[:2]) < size[0] / 2 + clearance
    return not np.any(beside & (np.abs(offset @ left[:2]) < size[1] / 2 + clearance))


def _texture_size(config: SceneConfig) -> Callable[[int], int]:
    return lambda size: max(16, round(size * config.texture_scale))
