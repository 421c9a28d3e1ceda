import numpy as np

from vgps.tracking.float_images import FloatImages


def test_an_image_is_converted_once_and_another_one_anew() -> None:
    images, rng = FloatImages(), np.random.default_rng(0)
    first, second = rng.integers(0, 256, (2, 5, 7), dtype=np.uint8)
    converted = images.of(first)
    assert images.of(first) is converted and converted.dtype == np.float32
    np.testing.assert_array_equal(images.of(second), second)
    np.testing.assert_array_equal(images.of(first), first)
    np.testing.assert_array_equal(images.of(first.copy()), first)
