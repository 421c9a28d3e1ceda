"""Alignment of points by a rigid motion or a similarity."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from trajectories import trajectory

from vgps.evaluation import align, trajectory_errors

NO_LEVER = np.zeros(3)


@pytest.mark.slow
@given(seed=st.integers(0, 1000), scale=st.floats(0.01, 100))
def test_alignment_inverts_a_similarity(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(10, 3))
    target = scale * Rotation.random(random_state=rng).apply(source) + rng.normal(size=3) * 1000
    similar = align(source, target, with_scale=True)
    assert similar is not None
    assert similar[0] == pytest.approx(scale)
    np.testing.assert_allclose(similar[1], 0.0, atol=1e-9 * max(scale, 1.0) * 1000)
    rigid = align(source, target, with_scale=False)
    assert rigid is not None
    # what a rigid motion leaves of a pure change of scale is that scale's share of the extent
    extent = np.linalg.norm(source - source.mean(axis=0), axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(rigid[1], axis=1), abs(scale - 1) * extent, rtol=1e-6, atol=1e-8
    )


def test_alignment_never_reflects() -> None:
    source = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 3], [0, 0, 0]])
    rigid = align(source, source * [1, 1, -1], with_scale=False)
    assert rigid is not None
    assert np.linalg.norm(rigid[1]) > 0.5


def test_undetermined_alignment_is_none() -> None:
    assert align(np.eye(3)[:2], np.eye(3)[:2], with_scale=False) is None
    assert align(np.zeros((5, 3)), np.eye(5)[:, :3], with_scale=True) is None
    times = np.arange(5.0)
    still = trajectory_errors(trajectory(times, [1, 2, 3]), trajectory(times, [0, 0, 0]), NO_LEVER)
    assert still.camera_position_after_se3_m is None
    assert still.sim3_scale is None


def test_a_straight_line_can_be_aligned() -> None:
    line = np.outer(np.arange(10.0), [1.0, 2.0, 3.0])
    similar = align(2 * line[:, ::-1] + 5, line, with_scale=True)
    assert similar is not None
    assert similar[0] == pytest.approx(0.5)
    np.testing.assert_allclose(similar[1], 0.0, atol=1e-9)
