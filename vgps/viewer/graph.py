"""A readable sample of the factor graph around the current time: poses, landmarks and GPS factors."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import rerun as rr

from vgps.model import IntArray
from vgps.solution import FrameState, Solution
from vgps.viewer import colours
from vgps.viewer.residuals import ReprojectedObservations, fix_placement, gps_results
from vgps.viewer.run_index import RunIndex
from vgps.viewer.run_stream import RunStream
from vgps.viewer.selection_details import SelectionDetails, fix_details, landmark_details, pose_details

GRAPH = "graph"
MAX_POSES, MAX_LANDMARKS, MAX_FIXES = 60, 60, 90
_MIN_IN_TRACK, _MAX_IN_TRACK = 3, 8  # poses of the sample in a long track
_STEP, _ROW, _LEVEL = 70.0, 260.0, 38.0  # between poses, rows of them, kinds of nodes; units of the view


@dataclass(frozen=True)
class Node:
    """A variable or a GPS factor: name, details, colour and position in the view."""

    name: str
    details: SelectionDetails
    colour: colours.Colour
    position: tuple[float, float]


@dataclass(frozen=True)
class Graph:
    """Nodes, and edges between their names."""

    nodes: list[Node]
    edges: list[tuple[str, str]]


class _Layout:
    """Positions of nodes: time runs to the right and back in the next row, so that the graph fits the view
    and consecutive rows join at their ends."""

    def __init__(self, frames: IntArray) -> None:
        self._frames = frames
        self._per_row = -(-len(frames) // max(1, round(np.sqrt(len(frames) / 5))))

    def position(self, frame: float, level: float) -> tuple[float, float]:
        """Return the position for a (fractional) frame; ``level`` counts downwards from the poses."""
        place = float(np.interp(frame, self._frames, np.arange(len(self._frames))))
        row = int((place + 0.5) // self._per_row)
        along = place - row * self._per_row
        along = self._per_row - 1.0 - along if row % 2 else along
        return along * _STEP, row * _ROW + level * _LEVEL


def log_graph(stream: RunStream, solution: Solution, observations: ReprojectedObservations) -> None:
    """Log the graph of each section of the run from its first frame on.

    Everything is on one entity, since an edge joins nodes of its own entity only.
    """
    for frames, graph in sample_graphs(solution, observations):
        stream.log_from_frame(
            GRAPH,
            int(frames[0]),
            rr.GraphNodes(
                [node.name for node in graph.nodes],
                positions=[node.position for node in graph.nodes],
                colors=[node.colour for node in graph.nodes],
                labels=[node.name for node in graph.nodes],
            ),
            rr.GraphEdges(graph.edges, graph_type="undirected"),
            rr.AnyValues(**_columns(graph)),
        )


def _columns(graph: Graph) -> dict[str, Any]:
    """Return the details of all nodes, a list per field."""
    names = [item.name for item in fields(SelectionDetails)]
    return {name: [getattr(node.details, name) for node in graph.nodes] for name in names}


def sample_graphs(solution: Solution, observations: ReprojectedObservations) -> list[tuple[IntArray, Graph]]:
    """Sample the factor graph of stage D, one small graph for each section of the run.

    A graph has every k-th pose ``x``, the landmarks ``l`` with the most observations in these poses, spread
    over the section, and a factor ``gps`` per fix, joined to the nearest of these poses. An edge from a pose
    to a landmark is a projection factor; one between successive poses stands for the landmarks that both see.
    k is such that a long track contains three to eight of these poses: with fewer, poses share no landmark;
    with more, the edges cannot be told apart.

    Returns:
        For each section its frames and its graph.
    """
    run, count = RunIndex(solution, observations), len(solution.t_s)
    track = _long_track(observations, len(solution.landmarks.sigma_px))
    step = max(1, int(np.clip(-(-count // MAX_POSES), track // _MAX_IN_TRACK, track // _MIN_IN_TRACK)))
    frames = np.arange(0, count, step)
    sections = np.array_split(frames, -(-len(frames) // MAX_POSES))
    return [(section, _graph(run, section, step)) for section in sections]


def _long_track(observations: ReprojectedObservations, landmarks: int) -> int:
    """Return the 90 % quantile of the number of frames that a track spans."""
    first, last = np.full(landmarks, np.iinfo(np.int64).max), np.full(landmarks, -1)
    np.minimum.at(first, observations.landmark, observations.frame)
    np.maximum.at(last, observations.landmark, observations.frame)
    observed = last >= 0
    return int(np.percentile((last - first)[observed], 90)) if observed.any() else 1


def _graph(run: RunIndex, frames: IntArray, step: int) -> Graph:
    observations, layout = run.observations, _Layout(frames)
    landmarks = _landmarks(run, frames)
    fixes = _fixes(run.solution, int(frames[0]), int(frames[-1]) + step)
    rows = [run.rows_of_landmark(int(landmark)) for landmark in landmarks]
    of_landmarks = np.concatenate(rows) if rows else np.zeros(0, np.int64)
    shown = of_landmarks[np.isin(observations.frame[of_landmarks], frames)]
    projections = [(f"x{observations.frame[row]}", f"l{observations.landmark[row]}") for row in shown]
    return Graph(
        [
            *(_pose_node(run, int(frame), layout) for frame in frames),
            *(_landmark_node(run, int(landmark), k, frames, layout) for k, landmark in enumerate(landmarks)),
            *(_fix_node(run, row, k, layout) for k, row in enumerate(fixes)),
        ],
        [*_pose_edges(run, frames), *projections, *_fix_edges(run.solution, fixes, frames)],
    )


def _landmarks(run: RunIndex, frames: IntArray) -> IntArray:
    """Return landmarks observed in two or more of the frames: of each part of the section the best."""
    observations = run.observations
    all_rows = np.arange(len(observations.frame))
    rows = np.concatenate([all_rows[run.rows_of_frame(int(frame))] for frame in frames])
    landmarks, first, views = np.unique(observations.landmark[rows], return_index=True, return_counts=True)
    begins, common = observations.frame[rows][first], views >= 2
    parts = min(MAX_LANDMARKS, len(frames))
    part = (begins - frames[0]) * parts // (frames[-1] - frames[0] + 1)
    order = np.lexsort((-views[common], part[common]))
    _, best = np.unique(part[common][order], return_index=True)
    return landmarks[common][order][best]


def _fixes(solution: Solution, first: int, end: int) -> list[int]:
    """Return fixes from the frame ``first`` to before ``end``, thinned out to what can be shown."""
    if solution.fixes is None:
        return []
    frame = fix_placement(solution).frame
    known = np.isfinite(solution.fixes.residual_m).all(axis=1)
    rows = np.flatnonzero(known & (frame >= first) & (frame < end))
    return [int(row) for row in rows[:: max(1, -(-len(rows) // MAX_FIXES))]]


def _fix_edges(solution: Solution, fixes: list[int], frames: IntArray) -> list[tuple[str, str]]:
    """Return an edge from each fix to the nearest of the poses."""
    if not fixes:
        return []
    fix_s = solution.fix_times_s[fixes]
    nearest = frames[np.argmin(np.abs(solution.t_s[frames] - fix_s[:, None]), axis=1)]
    return [(f"gps{row}", f"x{frame}") for row, frame in zip(fixes, nearest, strict=True)]


def _pose_edges(run: RunIndex, frames: IntArray) -> list[tuple[str, str]]:
    """Return edges between successive poses that observe a common landmark."""
    observed = [run.observations.landmark[run.rows_of_frame(int(frame))] for frame in frames]
    return [
        (f"x{a}", f"x{b}")
        for a, b, of_a, of_b in zip(frames[:-1], frames[1:], observed[:-1], observed[1:], strict=True)
        if len(np.intersect1d(of_a, of_b))
    ]


def _pose_node(run: RunIndex, frame: int, layout: _Layout) -> Node:
    bridged = run.solution.state[frame] is FrameState.BRIDGED
    colour = colours.BRIDGED if bridged else colours.POSE
    return Node(f"x{frame}", pose_details(run, frame), colour, layout.position(frame, 0.0))


def _landmark_node(run: RunIndex, landmark: int, k: int, frames: IntArray, layout: _Layout) -> Node:
    observed_in = run.observations.frame[run.rows_of_landmark(landmark)]
    middle = float(np.median(observed_in[np.isin(observed_in, frames)]))
    sigma = run.solution.landmarks.sigma_px[[landmark]]
    red, green, blue = colours.green_to_red(sigma, colours.GOOD_SIGMA_PX, colours.BAD_SIGMA_PX)[0].tolist()
    colour = (red, green, blue, 255)
    position = layout.position(middle, 1.2 + k % 3)
    return Node(f"l{landmark}", landmark_details(run, landmark), colour, position)


def _fix_node(run: RunIndex, row: int, k: int, layout: _Layout) -> Node:
    log, table = gps_results(run.solution)
    placement = fix_placement(run.solution)
    colour = colours.of_fix(log.fix_class[row], table.verdict[row])
    position = layout.position(float(placement.frame[row] + placement.alpha[row]), -1.2 - k % 2)
    return Node(f"gps{row}", fix_details(run, row), colour, position)
