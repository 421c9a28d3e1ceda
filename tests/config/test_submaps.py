"""Which recordings have submaps."""

import pytest

from vgps.config.submaps import SubmapsConfig


@pytest.mark.parametrize(
    ("frames", "total", "expected"),
    [("auto", 20_000, None), ("auto", 20_001, 5000), (300, 100, 300), (300, 100_000, 300)],
)
def test_only_long_recordings_have_submaps_unless_told_otherwise(frames, total, expected):
    assert SubmapsConfig(frames=frames).frames_of(total) == expected
