"""What enters iSAM2 with a window, and what does not."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, X
from synthetic_map import context, map_of, scene

from vgps.config import Config
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.mapping.zero_motion import ZeroMotion
from vgps.smoothing.scene.factor_graph import select_observations
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_c.fixed_lag import FixedLagGraph, GraphChange
from vgps.smoothing.stage_c.window_factors import WindowScene, frame_change, projection_change
from vgps.solution import Observations

CONTEXT = context(Config())
SINCE, NEWEST = 20, 39


def empty():
    return FixedLagGraph(19.0, {"x": np.full(6, 1e-3), "l": np.full(3, 1e-2)})


def first_window(offset=0):
    """Frames 20 to 39 of the drive, and those before them."""
    problem, _, _, _ = scene(disturbed=0.0)
    made, ids = scene_of_map(map_of(problem, 0, NEWEST), offset, NO_CONTROL_OBSERVATIONS)
    made, sigma_px = select_observations(made, CONTEXT)
    return WindowScene(
        scene=made, feature=ids, sigma_px=sigma_px, offset=offset, begin=SINCE, since=SINCE, new=SINCE
    )


def test_new_frames_bring_their_zero_motions_and_control_points():
    window = first_window(offset=10)
    held = [
        ZeroMotion(frame, reference, np.eye(4), np.full(6, 0.1)) for frame, reference in ((20, 15), (22, 9))
    ]
    window = replace(window, scene=replace(window.scene, zero_motions=tuple(held)))
    points = window.scene.points[:2]
    controls = ControlObservations(np.array([12, 35]), np.full((2, 2), 100.0), points, np.full((2, 3), 0.1))
    change = frame_change(window, replace(CONTEXT, controls=controls))
    # the second zero motion is relative to frame 19, the first control point was seen in frame 12
    assert [list(one.keys()) for one in change.factors.values()] == [[X(25), X(30)], [X(35)]]
    assert set(change.stamps) == {X(frame) for frame in range(SINCE, NEWEST + 1)}


def test_projections_before_the_window_have_only_points_as_variables():
    window, graph = first_window(), empty()
    change = projection_change(window, graph, CONTEXT)
    frames = [name[0] for name in change.factors if isinstance(name[0], int)]
    assert min(frames) < SINCE and max(frames) == NEWEST
    for name, factor in change.factors.items():
        if isinstance(name[0], int):
            held = name[0] < SINCE
            assert list(factor.keys()) == ([L(name[1])] if held else [X(name[0]), L(name[1])])
            assert isinstance(factor, gtsam.TriangulationFactorCal3_S2) == held


def test_a_point_enters_with_a_prior_once_its_rays_differ_by_a_degree():
    window, graph = first_window(), empty()
    entered = {name[1] for name in projection_change(window, graph, CONTEXT).factors if name[0] == "point"}
    seen = window.scene.observations
    for row in np.unique(seen.landmark[window.frame >= SINCE]).tolist():
        poses = window.scene.poses[seen.frame[seen.landmark == row]]
        rays = window.scene.points[row] - poses[:, :3, 3]
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        angle = np.degrees(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0)).max())
        if not 0.8 < angle < 1.3:  # by noise on either side
            assert (int(window.feature[row]) in entered) == (angle > 1.0)


@pytest.mark.slow
def test_a_projection_that_no_longer_agrees_leaves():
    window, graph = first_window(), empty()
    change = projection_change(window, graph, CONTEXT)
    held = gtsam.PriorFactorPose3(X(SINCE), gtsam.Pose3(window.pose(SINCE)), gtsam.noiseModel.Unit.Create(6))
    start = GraphChange(factors={("start", 0): held})
    graph.update(GraphChange.merged([frame_change(window, CONTEXT), change, start]), 2)
    seen = window.scene.observations
    kept = np.arange(len(seen.frame)) != np.flatnonzero(window.frame == 30)[0]
    gone = int(seen.frame[~kept][0]), int(window.feature[seen.landmark[~kept][0]])
    fewer = Observations(seen.frame[kept], seen.landmark[kept], seen.uv_px[kept])
    later = replace(window, scene=replace(window.scene, observations=fewer), new=NEWEST + 1)
    assert gone in change.factors
    assert projection_change(later, graph, CONTEXT).removed == {gone}
