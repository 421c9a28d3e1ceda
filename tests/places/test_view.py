import tempfile

import numpy as np

from vgps.places.view import on_disk


def test_images_of_any_size_come_back_from_the_file() -> None:
    rng = np.random.default_rng(0)
    made = [rng.integers(0, 256, shape, dtype=np.uint8) for shape in ((7, 13), (240, 321), (3, 3))]
    with tempfile.TemporaryFile() as file:
        for before, after in [(gray, on_disk(gray, file)) for gray in made]:
            np.testing.assert_array_equal(before, after)
            assert isinstance(after, np.memmap)
