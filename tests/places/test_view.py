import tempfile

import numpy as np

from vgps.places.view import View, matched, on_disk


def test_images_of_any_size_come_back_from_the_file() -> None:
    rng = np.random.default_rng(0)
    made = [rng.integers(0, 256, shape, dtype=np.uint8) for shape in ((7, 13), (240, 321), (3, 3))]
    with tempfile.TemporaryFile() as file:
        for before, after in [(gray, on_disk(gray, file)) for gray in made]:
            np.testing.assert_array_equal(before, after)
            assert isinstance(after, np.memmap)


def test_a_descriptor_with_two_equal_matches_has_none() -> None:
    rng = np.random.default_rng(0)
    descriptors = rng.integers(0, 256, (4, 32), dtype=np.uint8)
    points, uv = rng.normal(size=(4, 3)), rng.uniform(0, 100, (5, 2))

    def view(shown: np.ndarray, uv_px: np.ndarray) -> View:
        return View(
            frame=0,
            gray=np.zeros((1, 1), np.uint8),
            mask=None,
            uv_px=uv_px,
            descriptors=shown,
            near=np.arange(4),
            points=points,
            landmark=np.zeros(0, np.int64),
            raw_uv_px=np.zeros((0, 2)),
        )

    later = view(descriptors[[3, 1, 2, 2, 0]], uv)  # the third is there twice
    found = matched(view(descriptors, uv[:4]), later, ratio=0.8)
    np.testing.assert_array_equal(found.points, points[[0, 1, 3]])
    np.testing.assert_array_equal(found.uv_px, uv[[4, 1, 0]])
