"""Procedural textures with detail at every scale, for corners at every distance."""

import cv2
import numpy as np
import numpy.typing as npt
from scipy import fft

Image = npt.NDArray[np.uint8]  # (H, W, 4) blue, green, red, alpha
_Float = npt.NDArray[np.float32]

_WALLS = ((150, 175, 195), (165, 165, 160), (95, 110, 170), (190, 200, 205), (120, 150, 175), (175, 160, 140))
_CARS = ((60, 50, 160), (150, 90, 40), (200, 200, 200), (55, 55, 55), (70, 110, 60))


def noise(rng: np.random.Generator, height: int, width: int, slope: float) -> _Float:
    """Return (height, width) periodic noise, amplitude frequency^-slope, zero mean, unit variance."""
    spectrum = fft.rfft2(rng.standard_normal((height, width), dtype=np.float32))
    frequency = np.hypot(fft.fftfreq(height)[:, None], fft.rfftfreq(width)[None, :]).astype(np.float32)
    frequency[0, 0] = np.inf
    field = fft.irfft2(spectrum * frequency**-slope, s=(height, width)).astype(np.float32)
    return np.asarray((field - field.mean()) / field.std(), np.float32)


def leaves(rng: np.random.Generator, height: int, width: int, count: int, largest_px: float) -> _Float:
    """Return (height, width) overlapping discs and boxes in [-1, 1] of all sizes (a power law)."""
    image = np.zeros((height, width), np.float32)
    size = np.minimum(2.0 * rng.uniform(0.0005, 1.0, count) ** -0.7, largest_px)
    for x, y, r, shade, kind in zip(
        rng.uniform(0, width, count),
        rng.uniform(0, height, count),
        np.sort(size)[::-1],
        rng.uniform(-1, 1, count),
        rng.integers(0, 3, count),
        strict=True,
    ):
        center = (int(x), int(y))
        if kind == 0:
            cv2.circle(image, center, int(r), float(shade), -1, cv2.LINE_8)
        else:
            corner = (int(x + r * (1 + kind / 2)), int(y + 1.5 * r / kind))
            cv2.rectangle(image, center, corner, float(shade), -1)
    return image


def paving(rng: np.random.Generator, size: int, slabs: int) -> Image:
    """Return a square of pavement: slabs of differing shade with dark joints, stains, litter and grain."""
    shade = np.repeat(np.repeat(rng.normal(0, 9, (slabs, slabs)), size // slabs, 0), size // slabs, 1)
    slab = cv2.resize(shade.astype(np.float32), (size, size), interpolation=cv2.INTER_NEAREST)
    image = np.asarray(125 + slab + _grime(rng, size, size, size // 40), np.float32)
    joint = max(1, size // 640)
    for k in range(slabs):
        edge = k * size // slabs
        image[edge : edge + joint] -= 45
        image[:, edge : edge + joint] -= 45
    return _tinted(image, (0.97, 1.0, 1.02))


def asphalt(rng: np.random.Generator, size: int) -> Image:
    """Return a square of road: grain, patches and sealed cracks."""
    image = 105 + 1.4 * _grime(rng, size, size, size // 30)
    for _ in range(6):
        steps = rng.normal(0, size / 40, (30, 2)) + rng.normal(0, size / 50, 2)
        line = (rng.uniform(0, size, 2) + np.cumsum(steps, axis=0)).astype(np.int32)
        cv2.polylines(image, [line.reshape(-1, 1, 2)], False, 45.0, max(1, size // 300), cv2.LINE_AA)
    return _tinted(image, (1.02, 1.0, 0.98))


def facade(rng: np.random.Generator, height: int, width: int, style: int) -> Image:
    """Return a house front about 12 m wide and 10 m high: brick, plaster or panels, windows, a shop below."""
    wall = _brick(rng, height, width) if style % 3 == 0 else _plain_wall(rng, height, width, style % 3 == 2)
    image = _tinted(wall, tuple(c / 160 for c in _WALLS[style % len(_WALLS)]))
    floors, bays = 3 + style % 2, 4 + style % 3
    dy, dx = height / floors, width / bays
    for row in range(floors - 1):
        for column in range(bays):
            _window(rng, image, column * dx + 0.25 * dx, row * dy + 0.22 * dy, 0.5 * dx, 0.6 * dy)
        y = round((row + 1) * dy)
        cv2.rectangle(image, (0, y - height // 90), (width, y), (105, 110, 115, 255), -1)
    for column in range(bays):
        box = (column * dx + 0.1 * dx, height - 0.85 * dy, 0.8 * dx, 0.8 * dy)
        if rng.uniform() < 0.5:
            _paste(image, poster(rng, max(8, int(box[3])), max(8, int(box[2]))), int(box[0]), int(box[1]))
        else:
            _window(rng, image, *box)
    return image


def poster(rng: np.random.Generator, height: int, width: int) -> Image:
    """Return a board of coloured boxes and bars, like signs and shop windows."""
    image = np.full((height, width, 4), 255, np.uint8)
    image[..., :3] = rng.uniform(80, 200) + rng.uniform(-40, 40, 3)
    for scale in (0.6, 0.35, 0.2, 0.1, 0.05, 0.05, 0.03):
        for _ in range(int(2 / scale)):
            x, y = rng.uniform(0, width), rng.uniform(0, height)
            corner = (
                int(x + scale * width * rng.uniform(0.3, 1)),
                int(y + scale * height * rng.uniform(0.2, 1)),
            )
            color = (*(rng.uniform(25, 235) + rng.uniform(-30, 30, 3)).clip(0, 255), 255)
            cv2.rectangle(image, (int(x), int(y)), corner, color, -1)
    return image


def car_side(rng: np.random.Generator, height: int, width: int, glass: bool) -> Image:
    """Return the side of a car's body, with doors and wheels, or of its cabin."""
    paint = np.array(_CARS[rng.integers(len(_CARS))], np.float32)
    image = _tinted(100 + 0.4 * _grime(rng, height, width, width // 8), tuple(paint / 100))
    dark, light = (35, 35, 35, 255), (170, 175, 175, 255)
    if glass:
        for k in range(3):
            left = int((0.06 + 0.31 * k) * width)
            cv2.rectangle(
                image, (left, height // 8), (left + int(0.26 * width), 7 * height // 8), (60, 55, 50, 255), -1
            )
        return image
    for x in (0.2, 0.8):
        center = (int(x * width), int(0.78 * height))
        cv2.circle(image, center, int(0.085 * width), dark, -1, cv2.LINE_AA)
        cv2.circle(image, center, int(0.045 * width), light, -1, cv2.LINE_AA)
    for x in (0.33, 0.52, 0.7):
        cv2.line(image, (int(x * width), 0), (int(x * width), int(0.7 * height)), dark, max(1, width // 200))
        cv2.rectangle(
            image,
            (int(x * width) - width // 25, height // 4),
            (int(x * width) - width // 80, height // 3),
            light,
            -1,
        )
    return image


def tree(rng: np.random.Generator, size: int) -> Image:
    """Return a tree on a transparent background: a trunk and clumps of leaves."""
    image = np.zeros((size, size, 4), np.uint8)
    image[..., :3] = (45, 75, 60)  # may be mixed in at the edges by filtering
    cv2.rectangle(image, (int(0.47 * size), size // 2), (int(0.53 * size), size), (60, 75, 90, 255), -1)
    count = 2200
    angle, radius = rng.uniform(0, 2 * np.pi, count), 0.38 * size * np.sqrt(rng.uniform(0, 1, count))
    for a, r, shade, leaf in zip(
        angle, radius, rng.normal(1, 0.35, count), rng.uniform(0.006, 0.022, count), strict=True
    ):
        center = (int(size / 2 + r * np.cos(a)), int(0.4 * size + 0.9 * r * np.sin(a)))
        color = tuple(float(c) for c in np.clip(np.array([40, 95, 75]) * shade, 10, 220))
        cv2.ellipse(
            image,
            center,
            (max(1, int(leaf * size)), max(1, int(leaf * size * 0.6))),
            float(np.rad2deg(a)),
            0,
            360,
            (*color, 255),
            -1,
        )
    return image


def skyline(rng: np.random.Generator, height: int, width: int) -> Image:
    """Return distant houses and hills on a transparent background."""
    image = np.zeros((height, width, 4), np.uint8)
    image[..., :3] = (170, 160, 150)
    ridge = (height * (0.72 + 0.06 * noise(rng, 1, width, 1.2)[0])).astype(int)
    rows = np.arange(height)[:, None]
    image[rows >= ridge] = (125, 130, 105, 255)
    for _ in range(26):
        w, h, x = (
            int(rng.uniform(0.02, 0.07) * width),
            int(rng.uniform(0.2, 0.75) * height),
            int(rng.uniform(0, width)),
        )
        gray = int(rng.uniform(120, 190))
        cv2.rectangle(image, (x, height - h), (x + w, height), (gray, gray - 5, gray - 12, 255), -1)
        for y in range(height - h + 4, height - 3, 8):
            for c in range(x + 3, x + w - 4, 7):
                if rng.uniform() < 0.7:
                    cv2.rectangle(image, (c, y), (c + 3, y + 4), (gray - 60, gray - 65, gray - 70, 255), -1)
    return image


def sky(rng: np.random.Generator, size: int) -> Image:
    """Return a sky with clouds."""
    cover = np.clip(noise(rng, size, size, 1.6) * 0.6 + 0.35, 0, 1)[..., None]
    image = np.full((size, size, 4), 255, np.uint8)
    image[..., :3] = (1 - cover) * np.array([225, 185, 150]) + cover * np.array([240, 236, 232])
    return image


def _grime(rng: np.random.Generator, height: int, width: int, largest_px: float) -> _Float:
    """Return stains, litter and grain, in grey levels."""
    count = max(50, height * width // 400)
    return (
        9 * noise(rng, height, width, 1.3)
        + 8 * rng.standard_normal((height, width), dtype=np.float32)
        + 16 * leaves(rng, height, width, count, max(3.0, largest_px))
    )


def _brick(rng: np.random.Generator, height: int, width: int) -> _Float:
    """Return courses of brick, 8 cm high and 25 cm long on a front of 12 m by 10 m."""
    rows, columns = 120, 48
    y = np.arange(height)[:, None] * rows / height
    x = np.arange(width)[None, :] * columns / width + 0.5 * (y.astype(int) % 2)
    shade = rng.normal(0, 22, (rows, columns + 1)).astype(np.float32)
    image = 150 + shade[y.astype(int), x.astype(int)]
    image[(y % 1 < 0.12) | (x % 1 < 0.05)] = 178
    return np.asarray(image + 0.8 * _grime(rng, height, width, width / 60), np.float32)


def _plain_wall(rng: np.random.Generator, height: int, width: int, panels: bool) -> _Float:
    image = 160 + 1.2 * _grime(rng, height, width, width / 25)
    if panels:
        for k in range(1, 8):
            image[:, k * width // 8 - 2 : k * width // 8] -= 50
            image[k * height // 8 - 2 : k * height // 8] -= 50
    return image


def _window(rng: np.random.Generator, image: Image, x: float, y: float, w: float, h: float) -> None:
    """Paint a window with its frame, panes, a curtain or a reflection, and a sill."""
    edge = max(1, round(w / 16))
    left, top, right, bottom = round(x), round(y), round(x + w), round(y + h)
    frame = int(rng.choice([60, 215, 235]))
    cv2.rectangle(image, (left, top), (right, bottom), (frame, frame, frame, 255), -1)
    half = (left + right) // 2
    for a, b in ((left + edge, half - edge // 2), (half + edge // 2 + 1, right - edge)):
        glass = rng.uniform(25, 95)
        cv2.rectangle(image, (a, top + edge), (b, bottom - edge), (glass + 12, glass + 4, glass, 255), -1)
        blind = int(top + edge + rng.uniform(0, 0.8) * (bottom - top - 2 * edge))
        cv2.rectangle(
            image, (a, top + edge), (b, blind), (*(rng.uniform(120, 210) + rng.uniform(-20, 20, 3)), 255), -1
        )
        cv2.line(
            image,
            (a, bottom - edge),
            (b, (top + bottom) // 2),
            (glass + 60, glass + 50, glass + 45, 255),
            edge,
        )
    cv2.rectangle(image, (left - edge, bottom), (right + edge, bottom + edge), (205, 205, 200, 255), -1)


def _paste(image: Image, patch: Image, x: int, y: int) -> None:
    target = image[y : y + patch.shape[0], x : x + patch.shape[1]]
    target[:] = patch[: target.shape[0], : target.shape[1]]


def _tinted(gray: _Float, tint: tuple[float, ...]) -> Image:
    image = np.full((*gray.shape, 4), 255, np.uint8)
    image[..., :3] = np.clip(gray[..., None] * np.asarray(tint, np.float32), 0, 255)
    return image
