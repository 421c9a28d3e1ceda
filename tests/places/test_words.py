import numpy as np

from vgps.places.words import WordIndex


def test_a_view_is_most_like_itself_with_noise() -> None:
    rng = np.random.default_rng(3)
    views = [rng.integers(0, 256, (400, 32), dtype=np.uint8) for _ in range(30)]
    frequent = rng.integers(0, 256, (100, 32), dtype=np.uint8)  # what all of them show
    index = WordIndex()
    for frame, view in enumerate(views):
        index.add(10 * frame, index.words(np.concatenate([view, frequent])))
    # half of the seventh view again, a tenth of its bits wrong
    wrong = np.packbits(rng.random((200, 256)) < 0.1, axis=1)
    seen = np.concatenate([views[7][:200] ^ wrong, frequent, rng.integers(0, 256, (300, 32), dtype=np.uint8)])
    frames = [10 * k for k in range(30)]
    similarity = index.similarity(index.words(seen), frames)
    assert frames[int(np.argmax(similarity))] == 70
    assert similarity[7] > np.median(similarity) + 10 * np.std(np.delete(similarity, 7))
    assert index.similarity(index.words(views[7]), [70, 0])[0] == max(
        index.similarity(index.words(views[7]), frames)
    )


def test_a_view_without_features_is_like_nothing() -> None:
    index = WordIndex()
    index.add(1, index.words(np.zeros((0, 32), np.uint8)))
    assert index.similarity(index.words(np.ones((4, 32), np.uint8)), [1]).tolist() == [0.0]
    assert index.similarity(np.zeros(0, np.int64), []).tolist() == []


def test_candidates_are_the_nearest_and_of_the_others_the_most_alike() -> None:
    rng = np.random.default_rng(0)
    views = [rng.integers(0, 256, (50, 32), dtype=np.uint8) for _ in range(8)]
    index = WordIndex()
    for frame, view in enumerate(views):
        index.add(frame, index.words(view))
    seen = index.words(np.concatenate([views[5], views[2][:25]]))
    frames = np.array([7, 6, 0, 1, 2, 3, 4, 5])
    assert frames[index.candidates(seen, frames, 4)].tolist() == [7, 6, 5, 2]
    assert index.candidates(seen, frames[:1], 4).tolist() == [0]
