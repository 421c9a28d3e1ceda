import numpy as np
import pytest

from vgps.readers.gopro.gpmf import Block
from vgps.readers.gopro.sample_times import sample_times


def blocks(*rows: tuple[float, int, float]) -> list[Block]:
    """Of (stamp, samples, start), each shown for a second."""
    return [Block(stamp_s=stamp, samples=np.zeros((n, 1)), start_s=start) for stamp, n, start in rows]


def test_samples_lie_evenly_between_the_stamps_of_payloads():
    sensor = blocks((10.1, 4, 0.0), (11.3, 2, 1.0), (12.1, 2, 2.0))
    first_frame = Block(stamp_s=10.0, samples=np.zeros((30, 1)))
    np.testing.assert_allclose(
        sample_times(sensor, first_frame), [0.1, 0.4, 0.7, 1.0, 1.3, 1.7, 2.1, 2.5], atol=1e-12
    )
    # without a stream per frame, stamps are laid on the container's times: here 10.1, 10.3, 10.1 ahead
    np.testing.assert_allclose(sample_times(sensor)[[0, 4, 6]], [0.0, 1.2, 2.0], atol=1e-12)


def test_a_video_cut_at_its_beginning_keeps_its_clock():
    """The first payload is shown before the first frame that is left; SHUT starts with it."""
    sensor = blocks((10.1, 2, -0.4), (11.1, 2, 0.6))
    first_frame = Block(stamp_s=10.0, samples=np.zeros((30, 1)), start_s=-0.4)
    np.testing.assert_allclose(sample_times(sensor, first_frame), [-0.3, 0.2, 0.7, 1.2], atol=1e-12)


@pytest.mark.parametrize("stamps", [(np.nan, np.nan), (10.0, np.nan), (10.0, 0.1)])
def test_without_stamps_or_with_restarting_stamps_samples_are_spread(stamps):
    sensor = blocks((stamps[0], 4, 0.0), (stamps[1], 2, 1.0))
    np.testing.assert_allclose(sample_times(sensor), [0, 0.25, 0.5, 0.75, 1.0, 1.5])


def test_a_lost_payload_does_not_stretch_the_one_before_it():
    sensor = blocks((10.0, 4, 0.0), (11.0, 4, 1.0), (15.0, 4, 5.0))
    times = sample_times(sensor)
    np.testing.assert_allclose(times[4:9], [1.0, 1.25, 1.5, 1.75, 5.0], atol=1e-12)


def test_a_payload_without_samples_takes_no_time():
    sensor = blocks((10.0, 2, 0.0), (11.0, 0, 1.0), (12.0, 2, 2.0))
    np.testing.assert_allclose(sample_times(sensor), [0.0, 0.5, 2.0, 2.5], atol=1e-12)
