import numpy as np
import pytest

from vgps.simulate import textures


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_noise_has_its_mean_variance_and_spectrum_and_repeats() -> None:
    image = textures.noise(rng(), 128, 256, 1.0)
    assert abs(image.mean()) < 1e-4 and image.std() == pytest.approx(1.0, rel=1e-3)
    amplitude = np.abs(np.fft.rfft2(image))
    frequency = np.hypot(np.fft.fftfreq(128)[:, None], np.fft.rfftfreq(256)[None])
    near = [amplitude[np.abs(frequency / f - 1) < 0.1].mean() for f in (0.05, 0.2)]
    assert near[0] / near[1] == pytest.approx(4.0, rel=0.15)  # as 1 / frequency
    # the step over the border is like any other
    across = np.abs(image[:, 0] - image[:, -1]).mean()
    assert across < 2 * np.abs(np.diff(image, axis=1)).mean()


@pytest.mark.parametrize(
    "image",
    [
        textures.paving(rng(), 128, 8),
        textures.asphalt(rng(), 128),
        textures.facade(rng(), 104, 125, 1),
        textures.poster(rng(), 64, 64),
        textures.sky(rng(), 64),
    ],
    ids=["paving", "asphalt", "facade", "poster", "sky"],
)
def test_surfaces_are_opaque_and_have_contrast(image: np.ndarray) -> None:
    assert image.dtype == np.uint8 and image.shape[2] == 4
    assert (image[..., 3] == 255).all()
    assert image[..., :3].mean(axis=2).std() > 3


@pytest.mark.parametrize(
    "image", [textures.tree(rng(), 128), textures.skyline(rng(), 48, 256)], ids=["tree", "sky"]
)
def test_outlines_have_both_opaque_and_transparent_parts(image: np.ndarray) -> None:
    share = (image[..., 3] > 128).mean()
    assert 0.1 < share < 0.9
