"""Samples of the factor graph."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from vgps.solution import Landmarks, Observations, Solution
from vgps.viewer import colours
from vgps.viewer.graph import MAX_FIXES, MAX_LANDMARKS, MAX_POSES, Graph, sample_graphs
from vgps.viewer.residuals import reproject


def only(solution: Solution) -> Graph:
    ((_, graph),) = sample_graphs(solution, reproject(solution))
    return graph


def long_run(solution: Solution, frames: int, track: int) -> Solution:
    """A run in which a landmark begins in every frame and is observed in ``track`` frames."""
    poses = np.tile(solution.world_T_camera[0], (frames, 1, 1))
    frame, age = (grid.ravel() for grid in np.indices((frames, track)))
    seen = frame + age < frames
    return replace(
        solution,
        t_s=np.arange(frames) / 10,
        world_T_camera=poses,
        sigma_position_m=np.ones((frames, 3)),
        sigma_rotation_rad=np.ones((frames, 3)),
        state=solution.state[:1] * frames,
        landmarks=Landmarks(
            np.tile([0.0, 9.0, 0.0], (frames, 1)), np.ones(frames), np.zeros(frames, np.uint8)
        ),
        observations=Observations(
            (frame + age)[seen], frame[seen], np.tile([31.5, 23.5], (int(seen.sum()), 1))
        ),
    )


def test_a_small_run_is_shown_whole(solution: Solution) -> None:
    graph = only(solution)
    names = [node.name for node in graph.nodes]
    assert [name for name in names if name[0] == "x"] == ["x0", "x1", "x2", "x3", "x4", "x5"]
    # all three landmarks begin in the same frame, where one is shown
    assert len([name for name in names if name[0] == "l"]) == 1
    assert [name for name in names if name[0] == "g"] == ["gps0", "gps1", "gps2", "gps3"]
    assert ("gps0", "x0") in graph.edges
    assert ("gps3", "x3") in graph.edges
    assert ("x0", "x1") in graph.edges
    assert ("x0", "l0") in graph.edges


def test_nodes_have_the_colours_of_verdict_and_state(solution: Solution) -> None:
    colour = {node.name: node.colour for node in only(solution).nodes}
    assert colour["gps3"] == colours.REJECTED
    assert colour["gps2"] == colours.DOWN_CLASSED
    assert colour["x3"] == colours.BRIDGED
    assert colour["x2"] == colours.POSE


def test_a_time_offset_does_not_change_the_graph(solution: Solution, late: Solution) -> None:
    graph, shifted = only(solution), only(late)
    assert shifted.edges == graph.edges
    for node, moved in zip(graph.nodes, shifted.nodes, strict=True):
        assert (moved.name, moved.colour) == (node.name, node.colour)
        np.testing.assert_allclose(moved.position, node.position, atol=1e-9)


@pytest.mark.slow
def test_a_long_run_is_split_into_sections_with_connected_poses(solution: Solution) -> None:
    run = long_run(solution, frames=2500, track=30)
    graphs = sample_graphs(run, reproject(run))
    assert len(graphs) > 1
    assert np.all(np.diff(np.concatenate([frames for frames, _ in graphs])) <= 30 // 3)
    for frames, graph in graphs:
        names = {node.name for node in graph.nodes}
        kinds = [sum(name.startswith(letter) for name in names) for letter in ("x", "l", "gps")]
        assert 0 < kinds[0] <= MAX_POSES
        assert 0 < kinds[1] <= MAX_LANDMARKS
        assert kinds[2] <= MAX_FIXES
        assert {end for edge in graph.edges for end in edge} <= names
        chain = {(f"x{a}", f"x{b}") for a, b in itertools.pairwise(frames)}
        assert chain <= set(graph.edges)


def test_no_two_poses_have_the_same_position(solution: Solution) -> None:
    run = long_run(solution, frames=400, track=30)
    positions = [
        node.position
        for _, graph in sample_graphs(run, reproject(run))
        for node in graph.nodes
        if node.name[0] == "x"
    ]
    ((_, graph),) = sample_graphs(run, reproject(run))
    assert len(set(positions)) == len([node for node in graph.nodes if node.name[0] == "x"])
