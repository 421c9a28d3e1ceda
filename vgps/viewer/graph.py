"""The factor graph around the time shown: poses, landmarks, GPS factors, each with its residuals in words."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import rerun as rr

from vgps.model import IntArray
from vgps.solution import FrameState, Solution
from vgps.viewer import colours
from vgps.viewer.columns import Sheet
from vgps.viewer.descriptions import Facts, fix_facts, landmark_facts, pose_facts
from vgps.viewer.measures import ReprojectedObservations, fix_placement, judged
from vgps.viewer.row_index import Lookup

GRAPH = "graph"
MAX_POSES, MAX_LANDMARKS, MAX_FIXES = 60, 60, 90
_LEAST_IN_TRACK, _MOST_IN_TRACK = 3, 8  # poses of the sample
_STEP, _ROW, _LEVEL = 70.0, 260.0, 38.0  # between poses, rows of them, kinds of nodes; the view's points


@dataclass(frozen=True)
class Node:
    """A variable or a GPS factor: its name, what is said of it, its colour, and where it is drawn."""

    name: str
    facts: Facts
    colour: colours.Colour
    place: tuple[float, float]


@dataclass(frozen=True)
class Graph:
    """Nodes, and edges between their names."""

    nodes: list[Node]
    edges: list[tuple[str, str]]


class _Rows:
    """Where things are drawn: time runs to the right and back in the next row, so that the whole fits a
    view and rows join at their ends."""

    def __init__(self, frames: IntArray) -> None:
        self._frames = frames
        self._per_row = -(-len(frames) // max(1, round(np.sqrt(len(frames) / 5))))

    def at(self, frame: float, level: float) -> tuple[float, float]:
        """Of something at a frame, or between two; ``level`` counts downwards from the poses."""
        place = float(np.interp(frame, self._frames, np.arange(len(self._frames))))
        row = int((place + 0.5) // self._per_row)
        along = place - row * self._per_row
        along = self._per_row - 1.0 - along if row % 2 else along
        return along * _STEP, row * _ROW + level * _LEVEL


def log_graph(sheet: Sheet, solution: Solution, seen: ReprojectedObservations) -> None:
    """Log the graph of each stretch from its first frame on.

    Everything is on one entity, since an edge joins nodes of its own entity only.
    """
    for frames, graph in factor_graphs(solution, seen):
        sheet.from_frame(
            GRAPH,
            int(frames[0]),
            rr.GraphNodes(
                [node.name for node in graph.nodes],
                positions=[node.place for node in graph.nodes],
                colors=[node.colour for node in graph.nodes],
                labels=[node.name for node in graph.nodes],
            ),
            rr.GraphEdges(graph.edges, graph_type="undirected"),
            rr.AnyValues(**_columns(graph)),
        )


def _columns(graph: Graph) -> dict[str, Any]:
    """The facts of all nodes, a list for each kind."""
    return {item.name: [getattr(node.facts, item.name) for node in graph.nodes] for item in fields(Facts)}


def factor_graphs(solution: Solution, seen: ReprojectedObservations) -> list[tuple[IntArray, Graph]]:
    """Samples of the graph that stage D solves, small enough to read, one for each stretch of the run.

    Every k-th pose ``x``, the landmarks ``l`` with the most observations in these, spread over the stretch,
    and a factor ``gps`` per fix, joined to the nearest of these poses. An edge from a pose to a landmark is a
    projection factor; one from a pose to the next stands for the landmarks that both see. k is such that
    a long track holds three to eight of these poses: fewer share no landmark, more are a thicket of edges.

    Returns:
        For each stretch its frames and its graph.
    """
    run, count = Lookup(solution, seen), len(solution.t_s)
    track = _long_track(seen, len(solution.landmarks.sigma_px))
    step = max(1, int(np.clip(-(-count // MAX_POSES), track // _MOST_IN_TRACK, track // _LEAST_IN_TRACK)))
    frames = np.arange(0, count, step)
    stretches = np.array_split(frames, -(-len(frames) // MAX_POSES))
    return [(stretch, _graph(run, stretch, step)) for stretch in stretches]


def _long_track(seen: ReprojectedObservations, landmarks: int) -> int:
    """How many frames a long track spans: a tenth span more."""
    first, last = np.full(landmarks, np.iinfo(np.int64).max), np.full(landmarks, -1)
    np.minimum.at(first, seen.landmark, seen.frame)
    np.maximum.at(last, seen.landmark, seen.frame)
    seen_at_all = last >= 0
    return int(np.percentile((last - first)[seen_at_all], 90)) if seen_at_all.any() else 1


def _graph(run: Lookup, frames: IntArray, step: int) -> Graph:
    seen, places = run.seen, _Rows(frames)
    chosen = _landmarks(run, frames)
    fixes = _fixes(run.solution, int(frames[0]), int(frames[-1]) + step)
    rows = np.concatenate([run.of_landmark(int(landmark)) for landmark in chosen]) if len(chosen) else chosen
    shown = rows[np.isin(seen.frame[rows], frames)]
    edges = [(f"x{seen.frame[row]}", f"l{seen.landmark[row]}") for row in shown]
    return Graph(
        [
            *(_pose_node(run, int(frame), places) for frame in frames),
            *(_landmark_node(run, int(landmark), k, frames, places) for k, landmark in enumerate(chosen)),
            *(_fix_node(run, row, k, places) for k, row in enumerate(fixes)),
        ],
        [*_chain(run, frames), *edges, *_fix_edges(run.solution, fixes, frames)],
    )


def _landmarks(run: Lookup, frames: IntArray) -> IntArray:
    """Landmarks with observations in two or more of the frames: in each part of the stretch the best."""
    seen = run.seen
    rows = np.concatenate([np.arange(*run.rows_of_frame(int(frame))) for frame in frames])
    found, first, views = np.unique(seen.landmark[rows], return_index=True, return_counts=True)
    begins, common = seen.frame[rows][first], views >= 2
    parts = min(MAX_LANDMARKS, len(frames))
    part = (begins - frames[0]) * parts // (frames[-1] - frames[0] + 1)
    order = np.lexsort((-views[common], part[common]))
    _, best = np.unique(part[common][order], return_index=True)
    return found[common][order][best]


def _fixes(solution: Solution, first: int, end: int) -> list[int]:
    """Fixes from the frame ``first`` to before ``end``, so many as can be shown."""
    if solution.fixes is None or solution.gps is None:
        return []
    frame = fix_placement(solution).frame
    known = np.isfinite(solution.fixes.residual_m).all(axis=1)
    rows = np.flatnonzero(known & (frame >= first) & (frame < end))
    return [int(row) for row in rows[:: max(1, -(-len(rows) // MAX_FIXES))]]


def _fix_edges(solution: Solution, fixes: list[int], frames: IntArray) -> list[tuple[str, str]]:
    """From each fix to the nearest of the poses."""
    if not fixes:
        return []
    at_s = solution.fix_times_s[fixes]
    nearest = frames[np.argmin(np.abs(solution.t_s[frames] - at_s[:, None]), axis=1)]
    return [(f"gps{row}", f"x{frame}") for row, frame in zip(fixes, nearest, strict=True)]


def _chain(run: Lookup, frames: IntArray) -> list[tuple[str, str]]:
    """Edges between successive poses that see a landmark in common."""
    sets = [run.seen.landmark[run.of_frame(int(frame))] for frame in frames]
    return [
        (f"x{a}", f"x{b}")
        for a, b, of_a, of_b in zip(frames[:-1], frames[1:], sets[:-1], sets[1:], strict=True)
        if len(np.intersect1d(of_a, of_b))
    ]


def _pose_node(run: Lookup, frame: int, places: _Rows) -> Node:
    errors, acting = run.lengths_px[run.of_frame(frame)], run.fixes_of_frame.get(frame, [])
    bridged = run.solution.state[frame] is FrameState.BRIDGED
    return Node(
        f"x{frame}",
        pose_facts(run.solution, frame, errors, float(run.phi[frame]), acting),
        colours.BRIDGED if bridged else colours.POSE,
        places.at(frame, 0.0),
    )


def _landmark_node(run: Lookup, landmark: int, k: int, frames: IntArray, places: _Rows) -> Node:
    rows, sigma = run.of_landmark(landmark), run.solution.landmarks.sigma_px[[landmark]]
    seen_in = run.seen.frame[rows]
    red, green, blue = colours.green_to_red(sigma, colours.GOOD_SIGMA_PX, colours.BAD_SIGMA_PX)[0].tolist()
    return Node(
        f"l{landmark}",
        landmark_facts(run.solution, landmark, run.seen, rows),
        (red, green, blue, 255),
        places.at(float(np.median(seen_in[np.isin(seen_in, frames)])), 1.2 + k % 3),
    )


def _fix_node(run: Lookup, row: int, k: int, places: _Rows) -> Node:
    log, table = judged(run.solution)
    between = fix_placement(run.solution)
    return Node(
        f"gps{row}",
        fix_facts(run.solution, row, float(run.gps[row])),
        colours.of_fix(log.fix_class[row], table.verdict[row]),
        places.at(float(between.frame[row] + between.alpha[row]), -1.2 - k % 2),
    )
