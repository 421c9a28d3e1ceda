"""The sample of the factor graph."""

import itertools
from dataclasses import replace

import numpy as np

from vgps.solution import Landmarks, Observations, Solution
from vgps.viewer import colours
from vgps.viewer.graph import MAX_FIXES, MAX_LANDMARKS, MAX_POSES, Graph, factor_graphs
from vgps.viewer.measures import observations


def only(solution: Solution) -> Graph:
    ((_, graph),) = factor_graphs(solution, observations(solution))
    return graph


def long_run(solution: Solution, frames: int, track: int) -> Solution:
    """A landmark begins in every frame and is seen in ``track`` frames."""
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


def test_each_node_says_its_factors_and_residuals(solution: Solution) -> None:
    text = {node.name: node.facts.details for node in only(solution).nodes}
    assert "3 projection factors: rms 0.58 px, largest 1.00 px, Phi = 0.667" in text["x0"]
    assert "fix 0 (line 3) at 0.03 s: rtk_fix, used" in text["x0"]
    assert "fix 0" in text["x1"]  # the factor acts on both frames around the fix
    assert "fix 3" not in text["x3"]  # rejected: no factor
    assert "sigma_j = 0.50 px" in text["l0"]
    assert "frame 0: u -0.60, v +0.80 px" in text["l0"]
    assert "east -1.200, north +0.000, up +3.000 m" in text["gps1"]
    assert "omega Psi = 0.0625" in text["gps1"]
    assert "acts between frames 1 and 2" in text["gps1"]
    assert "no term in the energy" in text["gps3"]


def test_a_late_clock_changes_nothing_but_what_is_said_of_it(solution: Solution, late: Solution) -> None:
    graph, shifted = only(solution), only(late)
    assert shifted.edges == graph.edges
    for node, moved in zip(graph.nodes, shifted.nodes, strict=True):
        assert (moved.name, moved.colour) == (node.name, node.colour)
        np.testing.assert_allclose(moved.place, node.place, atol=1e-9)
        said = moved.facts.details.splitlines()
        if node.name[:3] == "gps":
            assert said.pop().endswith("s, +0.250 s of it the clock's lag")
        assert said == node.facts.details.splitlines()


def test_what_the_panel_shows_fits_a_line_of_it(solution: Solution) -> None:
    facts = {node.name: node.facts for node in only(solution).nodes}
    assert facts["x0"].factors == "3 video, 1 gps"
    assert facts["x0"].residual == "rms 0.58 px"
    assert facts["x3"].verdict == "bridged"
    assert facts["gps1"].residual == "-1.20 +0.00 +3.00 m"
    assert facts["gps1"].cost == "0.50 r, 0.50 h: 0.062"
    assert facts["gps1"].factors == "frames 1, 2"
    assert facts["gps3"].factors == "none"
    assert facts["gps3"].cost == "300.00 r, 0.00 h"
    assert facts["gps3"].verdict == "rtk_fix, rejected"
    assert facts["l0"].cost == "sigma_j 0.50 px"
    assert all(
        len(line) <= 28 for f in facts.values() for line in (f.what, f.factors, f.residual, f.cost, f.verdict)
    )


def test_nodes_have_the_colours_of_verdict_and_state(solution: Solution) -> None:
    colour = {node.name: node.colour for node in only(solution).nodes}
    assert colour["gps3"] == colours.REJECTED
    assert colour["gps2"] == colours.DOWN_CLASSED
    assert colour["x3"] == colours.BRIDGED
    assert colour["x2"] == colours.POSE


def test_a_long_run_comes_in_stretches_in_each_of_which_poses_hang_together(solution: Solution) -> None:
    run = long_run(solution, frames=2500, track=30)
    graphs = factor_graphs(run, observations(run))
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


def test_no_two_poses_lie_on_each_other(solution: Solution) -> None:
    run = long_run(solution, frames=400, track=30)
    places = [
        node.place
        for _, graph in factor_graphs(run, observations(run))
        for node in graph.nodes
        if node.name[0] == "x"
    ]
    ((_, graph),) = factor_graphs(run, observations(run))
    assert len(set(places)) == len([node for node in graph.nodes if node.name[0] == "x"])
