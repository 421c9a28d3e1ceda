import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

sys.path.append(str(Path(__file__).parent / "smoothing"))
from synthetic_map import MATRIX, away, map_of, scene

from vgps.pipeline.reconciliation import reconcile

TURN = Rotation.from_rotvec([0.02, 0.1, -0.03]).as_matrix()
SHIFT = np.array([1.0, -2.0, 0.5])


def grown():
    """A map of 60 frames, and its snapshot after 40."""
    problem, _, _, _ = scene(60, disturbed=0.0)
    local_map = map_of(problem, 0, 59)
    snapshot = map_of(problem, 0, 39)
    return local_map, snapshot


def test_a_similarity_of_the_old_part_becomes_one_of_the_whole():
    local_map, refined = grown()
    expected, _ = grown()
    expected.transform(1.1, TURN, SHIFT)
    refined.transform(1.1, TURN, SHIFT)
    reconcile(refined, local_map, MATRIX, 3.0)
    np.testing.assert_allclose(local_map.poses[:40], expected.poses[:40], atol=1e-12)
    assert away(local_map.poses, expected.poses) < 0.02
    known = np.isfinite(local_map.points[:, 0])
    np.testing.assert_allclose(local_map.points[known], expected.points[known], rtol=1e-9, atol=1e-9)


def test_new_frames_are_posed_by_the_refined_positions():
    """Their positions say that the newest frames drift away to the side: they follow no rigid motion."""
    local_map, refined = grown()
    true = local_map.poses.copy()
    drift = np.linspace(0.0, 0.4, 21)[1:]
    local_map.poses[40:, 0, 3] += drift
    reconcile(refined, local_map, MATRIX, 30.0)
    assert away(local_map.poses[40:], true[40:]) < 0.25 * float(drift.mean())


def test_what_was_forgotten_or_given_up_since_stays_so():
    local_map, refined = grown()
    twin, same = grown()
    given_up = local_map.ids[:3]
    local_map.forget_points(given_up)
    twin.forget_points(given_up)
    twin.forget(20, 25)
    refined.transform(1.1, TURN, SHIFT)
    same.transform(1.1, TURN, SHIFT)
    reconcile(refined, local_map, MATRIX, 3.0)
    reconcile(same, twin, MATRIX, 3.0)
    assert np.isnan(local_map.points[given_up]).all()
    np.testing.assert_allclose(twin.poses, local_map.poses[20:], atol=1e-12)
    np.testing.assert_allclose(twin.points[twin.ids], local_map.points[local_map.ids], atol=1e-12)


def test_features_the_copy_does_not_know_are_named():
    local_map, refined = grown()
    new = reconcile(refined, local_map, MATRIX, 3.0)
    assert len(new) and new.min() >= refined.feature_count
    refined.forget_points(refined.ids[:2])
    local_map, _ = grown()
    assert set(refined.ids[:2]) <= set(reconcile(refined, local_map, MATRIX, 3.0))


def test_a_snapshot_does_not_follow_the_map():
    local_map, _ = grown()
    snapshot = local_map.snapshot()
    before = snapshot.poses.copy(), snapshot.points.copy(), snapshot.observations().uv_px.copy()
    local_map.transform(2.0, TURN, SHIFT)
    local_map.poses[:] += 1.0
    local_map.set_points(local_map.ids, np.zeros((len(local_map.ids), 3)), np.ones(len(local_map.ids)))
    nothing = np.zeros(len(local_map.ids), dtype=bool)
    local_map.append_pose(np.eye(4))
    local_map.push_view(60, local_map.raw_uv_px, local_map.last_uv_px, ~nothing)
    for was, now in zip(
        before, (snapshot.poses, snapshot.points, snapshot.observations().uv_px), strict=True
    ):
        np.testing.assert_array_equal(was, now)
    assert snapshot.next_frame == 60 == local_map.next_frame - 1


@pytest.mark.parametrize("frames", [41, 60])
def test_nothing_changes_where_stage_c_changed_nothing(frames):
    problem, _, _, _ = scene(60, disturbed=0.0)
    local_map, refined = map_of(problem, 0, frames - 1), map_of(problem, 0, 39)
    before = local_map.poses.copy(), local_map.points.copy()
    reconcile(refined, local_map, MATRIX, 3.0)
    np.testing.assert_array_equal(local_map.poses[:40], before[0][:40])
    assert away(local_map.poses, before[0]) < 0.02
    np.testing.assert_allclose(local_map.points, before[1], atol=1e-12)
