"""The factor graph: a sample of poses, landmarks and GPS factors, each with its residuals in words."""

from dataclasses import dataclass

import numpy as np
import rerun as rr

from vgps.model import FloatArray, IntArray
from vgps.solution import Solution
from vgps.viewer import colours
from vgps.viewer.measures import Sightings, gps_terms, judged, video_terms
from vgps.viewer.sheet import Sheet
from vgps.viewer.words import fix_text, landmark_text, pose_text

GRAPH = "graph"
MAX_POSES, MAX_LANDMARKS, MAX_FIXES = 90, 80, 90
_STEP, _ROW = 70.0, 260.0  # between poses, and between rows of poses, in points of the view
_LEVEL = 38.0


@dataclass(frozen=True)
class Node:
    """A variable or a GPS factor: its name, what is said of it, its colour, and where it is drawn."""

    name: str
    text: str
    colour: colours.Colour
    place: tuple[float, float]


@dataclass(frozen=True)
class Graph:
    """Nodes, and edges between their names."""

    nodes: list[Node]
    edges: list[tuple[str, str]]


def log_graph(sheet: Sheet, graph: Graph) -> None:
    """Log the graph; everything on one entity, since an edge joins nodes of its own entity only."""
    sheet.static(
        GRAPH,
        rr.GraphNodes(
            [node.name for node in graph.nodes],
            positions=[node.place for node in graph.nodes],
            colors=[node.colour for node in graph.nodes],
            labels=[node.name for node in graph.nodes],
        ),
        rr.GraphEdges(graph.edges, graph_type="undirected"),
        rr.AnyValues(factors=[node.text for node in graph.nodes]),
    )


def factor_graph(solution: Solution, seen: Sightings) -> Graph:
    """A sample of the graph that stage D solves, small enough to read.

    Every k-th pose ``x``, the landmarks ``l`` with the most sightings in these, spread over the run, and a
    factor ``gps`` per fix, joined to the nearest of these poses; an edge from a pose to a landmark is a
    projection factor, one from a pose to the next stands for the landmarks that both see.
    """
    frames = _every(len(solution.t_s), MAX_POSES)
    places = _Rows(frames)
    chosen = _landmarks(seen, frames, len(solution.landmarks.sigma_px))
    fixes = _fixes(solution)
    shown = np.isin(seen.frame, frames) & np.isin(seen.landmark, chosen)
    projections = [
        (f"x{frame}", f"l{landmark}")
        for frame, landmark in zip(seen.frame[shown], seen.landmark[shown], strict=True)
    ]
    nodes = [
        *_pose_nodes(solution, seen, frames, places),
        *_landmark_nodes(solution, seen, chosen, frames, places),
        *_fix_nodes(solution, fixes, places),
    ]
    return Graph(
        nodes,
        [
            *_chain(seen, frames),
            *projections,
            *_fix_edges(solution, fixes, frames),
        ],
    )


class _Rows:
    """Where things are drawn: time runs to the right and back in the next row, so that the whole fits a
    view and rows join at their ends."""

    def __init__(self, frames: IntArray) -> None:
        self._frames = frames
        rows = max(1, round(np.sqrt(len(frames) / 5)))
        self._per_row = -(-len(frames) // rows)

    def at(self, frame: float, level: float) -> tuple[float, float]:
        """Of something at a frame, or between two; ``level`` counts downwards from the poses."""
        place = float(np.interp(frame, self._frames, np.arange(len(self._frames))))
        row = int((place + 0.5) // self._per_row)
        along = place - row * self._per_row
        along = self._per_row - 1.0 - along if row % 2 else along
        return along * _STEP, row * _ROW + level * _LEVEL


def _every(count: int, most: int) -> IntArray:
    return np.arange(0, count, max(1, -(-count // most)))


def _fixes(solution: Solution) -> list[int]:
    if solution.fixes is None:
        return []
    within = np.flatnonzero(np.isfinite(solution.fixes.residual_m).all(axis=1))
    return [int(row) for row in within[_every(len(within), MAX_FIXES)]] if len(within) else []


def _fix_edges(solution: Solution, fixes: list[int], frames: IntArray) -> list[tuple[str, str]]:
    """From each fix to the nearest of the poses."""
    if not fixes:
        return []
    at_s = judged(solution)[0].t_s[fixes]
    nearest = frames[np.argmin(np.abs(solution.t_s[frames] - at_s[:, None]), axis=1)]
    return [(f"gps{row}", f"x{frame}") for row, frame in zip(fixes, nearest, strict=True)]


def _landmarks(seen: Sightings, frames: IntArray, count: int) -> IntArray:
    """Landmarks with sightings in two or more of the frames, the best in each stretch of the run."""
    rows = np.flatnonzero(np.isin(seen.frame, frames))
    views = np.bincount(seen.landmark[rows], minlength=count)
    first = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(first, seen.landmark[rows], seen.frame[rows])
    usable = np.flatnonzero(views >= 2)
    if not len(usable):
        return usable
    stretch = first[usable] * MAX_LANDMARKS // (int(seen.frame.max()) + 1)
    by_views = usable[np.lexsort((-views[usable], stretch))]
    _, best = np.unique(np.sort(stretch), return_index=True)
    return by_views[best]


def _chain(seen: Sightings, frames: IntArray) -> list[tuple[str, str]]:
    """Edges between successive poses that see a landmark in common."""
    start = np.concatenate([[0], np.cumsum(seen.per_frame)])
    sets = [seen.landmark[start[frame] : start[frame + 1]] for frame in frames]
    return [
        (f"x{a}", f"x{b}")
        for a, b, of_a, of_b in zip(frames[:-1], frames[1:], sets[:-1], sets[1:], strict=True)
        if len(np.intersect1d(of_a, of_b))
    ]


def _pose_nodes(solution: Solution, seen: Sightings, frames: IntArray, places: _Rows) -> list[Node]:
    start = np.concatenate([[0], np.cumsum(seen.per_frame)])
    lengths, phi = seen.length_px, video_terms(solution, seen)
    acting = _fixes_by_frame(solution)
    return [
        Node(
            f"x{frame}",
            pose_text(
                solution,
                int(frame),
                lengths[start[frame] : start[frame + 1]],
                float(phi[frame]),
                acting.get(int(frame), []),
            ),
            colours.POSE if solution.state[frame] == "tracked" else colours.BRIDGED,
            places.at(float(frame), 0.0),
        )
        for frame in frames
    ]


def _fixes_by_frame(solution: Solution) -> dict[int, list[int]]:
    """The fixes whose factors act on each frame: the one before and the one after."""
    acting: dict[int, list[int]] = {}
    if solution.fixes is None or solution.gps is None:
        return acting
    before = np.searchsorted(solution.t_s, solution.gps.t_s, side="right") - 1
    for row in np.flatnonzero(solution.fixes.used):
        for frame in (before[row], before[row] + 1):
            acting.setdefault(int(frame), []).append(int(row))
    return acting


def _landmark_nodes(
    solution: Solution, seen: Sightings, chosen: IntArray, frames: IntArray, places: _Rows
) -> list[Node]:
    nodes = []
    sigma = solution.landmarks.sigma_px[chosen]
    tints = colours.green_to_red(sigma, colours.GOOD_SIGMA_PX, colours.BAD_SIGMA_PX)
    for k, landmark in enumerate(chosen):
        rows = np.flatnonzero(seen.landmark == landmark)
        middle = float(np.median(seen.frame[rows][np.isin(seen.frame[rows], frames)]))
        nodes.append(
            Node(
                f"l{landmark}",
                landmark_text(solution, int(landmark), seen, rows),
                (*(int(c) for c in tints[k]), 255),  # type: ignore[arg-type]
                places.at(middle, 1.2 + k % 3),
            )
        )
    return nodes


def _fix_nodes(solution: Solution, fixes: list[int], places: _Rows) -> list[Node]:
    table, log, terms = solution.fixes, solution.gps, gps_terms(solution)
    if table is None or log is None:
        return []
    at: FloatArray = np.interp(log.t_s, solution.t_s, np.arange(len(solution.t_s)))
    return [
        Node(
            f"gps{row}",
            fix_text(solution, row, float(terms[row])),
            colours.of_fix(log.fix_class[row], table.verdict[row]),
            places.at(float(at[row]), -1.2 - k % 2),
        )
        for k, row in enumerate(fixes)
    ]
