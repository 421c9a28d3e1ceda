import numpy as np
import pytest
from synthetic_bundle import drive, keep_observations

from vgps.solver.equations.chunks import Chunk, LandmarkGroup, split_into_chunks
from vgps.solver.equations.landmark_groups import group_by_track, track_ends
from vgps.solver.matrices.band_matrix import BandMatrix


@pytest.mark.parametrize("frames", [[2, 3, 4], [0, 3, 9]])
def test_square_of_a_group_is_subtracted_at_its_frames(frames: list[int]) -> None:
    Z = np.random.default_rng(0).normal(size=(6, 18))
    band = BandMatrix.zeros(60, 61)
    group = LandmarkGroup(np.array(frames), 2, 5)
    buffer = np.append(np.full(5, np.nan), Z.ravel())
    band.subtract_square(group.frames, group.matrix(buffer))
    columns = (6 * np.array(frames)[:, None] + np.arange(6)).ravel()
    expected = np.zeros((60, 60))
    expected[np.ix_(columns, columns)] = -Z.T @ Z
    i, j = np.tril_indices(60)
    np.testing.assert_allclose(band.ab[i - j, j], expected[i, j], atol=1e-13)


@pytest.fixture
def chunks(monkeypatch: pytest.MonkeyPatch) -> tuple[Chunk, ...]:
    """The observations of a drive in small chunks; frames 2 and 5 are held."""
    monkeypatch.setattr("vgps.solver.equations.chunks.CHUNK_OBSERVATIONS", 200)
    problem, _ = drive(frames=20, landmarks=150)
    free = np.full(20, -1)
    free[np.setdiff1d(np.arange(20), [2, 5])] = np.arange(18)
    _, group = group_by_track(*track_ends(free[problem.frame], problem.landmark, 150))
    return split_into_chunks(problem, free, group)


def test_every_observation_is_in_one_chunk_with_its_landmark(chunks: tuple[Chunk, ...]) -> None:
    problem, _ = drive(frames=20, landmarks=150)
    assert len(chunks) > 3
    pairs = [(c.first_frame + c.frame) * 150 + c.landmarks[c.landmark] for c in chunks]
    np.testing.assert_array_equal(
        np.sort(np.concatenate(pairs)), np.sort(problem.frame * 150 + problem.landmark)
    )
    landmarks = np.concatenate([chunk.landmarks for chunk in chunks])
    assert len(np.unique(landmarks)) == len(landmarks)


def test_sums_by_frame_are_those_of_the_observations(chunks: tuple[Chunk, ...]) -> None:
    for chunk in chunks:
        values = np.random.default_rng(0).normal(size=len(chunk.frame))
        expected = [values[chunk.frame == frame].sum() for frame in range(chunk.frames)]
        np.testing.assert_allclose(chunk.sum_by_frame(values), expected, atol=1e-12)


def test_observations_in_held_frames_have_no_entries(chunks: tuple[Chunk, ...]) -> None:
    for chunk in chunks:
        frame = chunk.first_frame + chunk.frame
        np.testing.assert_array_equal(chunk.free_rows, np.flatnonzero(~np.isin(frame, [2, 5])))
        assert chunk.entry.shape == (len(chunk.free_rows), 3)


def test_squares_of_the_groups_equal_those_of_their_landmarks(chunks: tuple[Chunk, ...]) -> None:
    """Each observation gets a random (3, 6) matrix; a landmark's matrices side by side are its own Z."""
    rng, free = np.random.default_rng(0), np.insert(np.arange(18), [2, 4], -1)
    expected, band = np.zeros((108, 108)), BandMatrix.zeros(108, 109)
    for chunk in chunks:
        Z, buffer = rng.normal(size=(len(chunk.free_rows), 3, 6)), np.zeros(chunk.size)
        for row, entry in zip(Z, chunk.entry, strict=True):
            buffer[entry[:, None] + np.arange(6)] = row
        for group in chunk.groups:
            band.subtract_square(group.frames, group.matrix(buffer))
        column = free[(chunk.first_frame + chunk.frame)[chunk.free_rows]]
        for landmark in range(len(chunk.landmarks)):
            rows = np.flatnonzero(chunk.landmark[chunk.free_rows] == landmark)
            own = np.zeros((3, 108))
            for row in rows:
                own[:, 6 * column[row] : 6 * column[row] + 6] = Z[row]
            expected -= own.T @ own
    i, j = np.tril_indices(108)
    np.testing.assert_allclose(band.ab[i - j, j], expected[i, j], atol=1e-11)


def test_states_between_frames_of_a_group_and_short_gaps_are_zero_columns() -> None:
    """Two states after frame 3 and one after 6; frames 5 and 8 see nothing, the latter among 19 places."""
    problem, _ = drive(frames=12, landmarks=60)
    problem = keep_observations(problem, (problem.frame != 5) & (problem.frame != 8))
    free = np.array([0, 1, 2, 3, 6, 7, 8, 10, 20, 30, 32, 33])
    (chunk,) = split_into_chunks(problem, free, np.zeros(60, dtype=np.int64))
    (group,) = chunk.groups
    np.testing.assert_array_equal(group.frames, np.setdiff1d(np.arange(34), np.arange(11, 30)))
    assert not group.contiguous
    column = (chunk.entry - group.start) % group.width // 6
    place = free[(chunk.first_frame + chunk.frame)[chunk.free_rows]]
    np.testing.assert_array_equal(group.frames[column], np.tile(place[:, None], 3))


def test_uninterrupted_tracks_around_states_are_one_dense_block() -> None:
    problem, _ = drive(frames=12, landmarks=60)
    free = np.arange(12) + np.arange(12) // 4
    chunks = split_into_chunks(problem, free, np.arange(60) // 20)
    assert all(g.contiguous for chunk in chunks for g in chunk.groups)
