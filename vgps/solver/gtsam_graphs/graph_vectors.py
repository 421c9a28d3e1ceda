"""Vectors of a GTSAM graph: those of a place in the video become states, all others are shared."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import gtsam

from vgps.model import FloatArray
from vgps.solver.state_vectors import MAX_STATE_SIZE, StateVector


@dataclass
class _Ties:
    """Frames and vectors with which a vector shares factors, and whether it is an observed point."""

    frames: list[int] = field(default_factory=list)
    vectors: set[int] = field(default_factory=set)
    is_point: bool = False


def split_vectors(
    graph: gtsam.NonlinearFactorGraph,
    vectors: Mapping[int, FloatArray],
    frame_of: Mapping[int, int],
    max_span: int,
) -> tuple[dict[int, FloatArray], dict[int, StateVector]]:
    """Split vectors into shared ones and states.

    A state has at most six coordinates, and all frames with which it shares factors lie close together; it is
    placed at the first of them. One that shares factors with other vectors only, such as a link of a chain
    without measurements, is placed at the nearest of these. Observed points are shared: many of them belong
    to the same frames, whose band they would widen.

    Args:
        graph: All factors on the vectors.
        vectors: Their values by key.
        frame_of: Frames by the keys of the poses.
        max_span: Number of frames from the first to the last below which frames are close together.
    """
    ties = _ties(graph, vectors, frame_of)
    able = {key for key in ties if len(vectors[key]) <= MAX_STATE_SIZE and not ties[key].is_point}
    places = {key: _first(ties[key].frames, max_span) for key in able}
    placed = {key: place for key, place in places.items() if place is not None}
    queue = deque(sorted(placed, key=lambda key: (placed[key], key)))
    while queue:
        for key in sorted(ties[queue.popleft()].vectors & able - placed.keys()):
            near = _first([placed[other] for other in ties[key].vectors if other in placed], max_span)
            if not ties[key].frames and near is not None:
                placed[key] = near
                queue.append(key)
    shared = {key: vector for key, vector in vectors.items() if key not in placed}
    return shared, {key: StateVector(vectors[key], placed[key]) for key in sorted(placed)}


def _first(frames: list[int], max_span: int) -> int | None:
    """Return the first frame if all are close together; None if they are not, or if there are none."""
    return min(frames) if frames and max(frames) - min(frames) < max_span else None


def _ties(
    graph: gtsam.NonlinearFactorGraph, vectors: Mapping[int, FloatArray], frame_of: Mapping[int, int]
) -> dict[int, _Ties]:
    ties = {key: _Ties() for key in vectors}
    for factor in map(graph.at, range(graph.size())):
        keys = list(factor.keys())
        own = ties.keys() & keys
        for key in own:
            ties[key].frames += [frame_of[other] for other in keys if other in frame_of]
            ties[key].vectors |= own - {key}
            ties[key].is_point |= isinstance(factor, gtsam.GenericProjectionFactorCal3_S2)
    return ties
