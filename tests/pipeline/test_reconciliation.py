from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_map import CAMERA, away, map_of, moved, no_positions, scene
from synthetic_rows import rolling_drive

from vgps.config import MappingConfig, TrackingConfig
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView, Positions, Similarity
from vgps.mapping.zero_motion import ZeroMotion
from vgps.pipeline.later_frames import PosingLimits
from vgps.pipeline.reconciliation import reconcile

pytestmark = pytest.mark.slow

TO_WORLD = Similarity(1.1, Rotation.from_rotvec([0.02, 0.1, -0.03]).as_matrix(), np.array([1.0, -2.0, 0.5]))
MOVED = MapUpdate(similarity=TO_WORLD)


def grown():
    """A map of 60 frames, and its snapshot after 40."""
    problem, _, _, _ = scene(60, disturbed=0.0)
    return map_of(problem, 0, 59), map_of(problem, 0, 39)


def limits(inlier_px):
    return PosingLimits(TrackingConfig(inlier_px=inlier_px), MappingConfig(), 12)


def reconciled(refined, local_map, inlier_px=3.0):
    """The features that stage C did not refine, after the map was updated."""
    found = reconcile(refined, local_map, CAMERA, limits(inlier_px))
    local_map.apply(found.update)
    return found.unrefined


def remove(local_map, ids):
    local_map.apply(MapUpdate(positions=no_positions(ids)))


def test_a_similarity_of_the_old_part_becomes_one_of_the_whole():
    local_map, refined = grown()
    expected, _ = grown()
    expected.apply(MOVED)
    refined.apply(MOVED)
    reconciled(refined, local_map)
    np.testing.assert_allclose(local_map.poses[:40], expected.poses[:40], atol=1e-12)
    assert away(local_map.poses, expected.poses) < 0.02
    known = np.isfinite(local_map.points[:, 0])
    np.testing.assert_allclose(local_map.points[known], expected.points[known], rtol=1e-9, atol=1e-9)


def test_the_map_itself_is_not_changed():
    local_map, refined = grown()
    before = local_map.poses.copy(), local_map.points.copy()
    refined.apply(MOVED)
    reconcile(refined, local_map, CAMERA, limits(3.0))
    np.testing.assert_array_equal(local_map.poses, before[0])
    np.testing.assert_array_equal(local_map.points, before[1])


def test_new_frames_are_posed_by_the_refined_positions():
    """The newest frames drift to the side, which the refined positions contradict."""
    local_map, refined = grown()
    true = local_map.poses.copy()
    drift = np.linspace(0.0, 0.4, 21)[1:]

    def drifted(poses):
        poses[:, 0, 3] += drift
        return poses

    moved(local_map, 40, drifted)
    reconciled(refined, local_map, 30.0)
    assert away(local_map.poses[40:], true[40:]) < 0.25 * float(drift.mean())


def test_the_bending_is_that_of_the_snapshot_where_it_has_one():
    local_map, refined = grown()
    refined.apply(MapUpdate(first_frame=10, poses=refined.poses[10:].copy(), bending=np.arange(30.0)))
    reconciled(refined, local_map)
    local_map.discard_before(20, 20)
    refined.apply(MapUpdate(first_frame=30, poses=refined.poses[30:].copy(), bending=np.ones(10)))
    reconciled(refined, local_map)
    np.testing.assert_array_equal(local_map.bending[:20], [*np.arange(10.0, 20.0), *np.ones(10)])
    assert np.isnan(local_map.bending[20:]).all()


def test_new_features_carry_on_what_the_refined_ones_show():
    """The tracked scale slips more and more; hardly a refined feature is left in the end."""
    problem, poses, _, _ = scene(60, disturbed=0.0)
    local_map, refined = map_of(problem, 0, 59), map_of(problem, 0, 29)
    seen = local_map.observations(59).landmark
    assert (seen < refined.feature_count).sum() < 12
    centres = poses[29:, :3, 3]
    steps = np.diff(centres, axis=0) * np.linspace(1.0, 1.5, 30)[:, None]

    def slipped(later):
        later[:, :3, 3] = centres[0] + np.cumsum(steps, axis=0)
        return later

    moved(local_map, 30, slipped)
    new = np.arange(refined.feature_count, local_map.feature_count)
    remove(local_map, new[::2])
    reconciled(refined, local_map)
    assert away(local_map.poses[30:], poses[30:]) < 0.1


def test_frames_of_a_rolling_shutter_are_posed_at_their_middle_rows():
    """As those of a global shutter they are 0.2 m off on average."""
    problem, poses = rolling_drive(noise_px=0.0, frames=60, landmarks=700, disturbed=0.0)
    local_map, refined = map_of(problem, 0, 59), map_of(problem, 0, 39)
    rolling = replace(CAMERA, readout_s=0.06)
    local_map.apply(reconcile(refined, local_map, rolling, limits(3.0)).update)
    assert away(local_map.poses[40:], poses[40:]) < 0.02


def test_discarded_frames_and_removed_positions_stay_so():
    local_map, refined = grown()
    twin, same = grown()
    given_up = local_map.ids[:3]
    remove(local_map, given_up)
    remove(twin, given_up)
    twin.discard_before(20, 25)
    refined.apply(MOVED)
    same.apply(MOVED)
    reconciled(refined, local_map)
    reconciled(same, twin)
    assert np.isnan(local_map.points[given_up]).all()
    np.testing.assert_allclose(twin.poses, local_map.poses[20:], atol=1e-12)
    np.testing.assert_allclose(twin.points[twin.ids], local_map.points[local_map.ids], atol=1e-12)


def test_features_without_a_refined_position_are_listed():
    local_map, refined = grown()
    new = reconciled(refined, local_map)
    assert len(new) and new.min() >= refined.feature_count
    remove(refined, refined.ids[:2])
    local_map, _ = grown()
    assert set(refined.ids[:2]) <= set(reconciled(refined, local_map))


def test_a_snapshot_does_not_follow_the_map():
    local_map, _ = grown()
    snapshot = local_map.snapshot()
    before = snapshot.poses.copy(), snapshot.points.copy(), snapshot.observations().uv_px.copy()
    local_map.apply(MOVED)
    count = len(local_map.ids)
    view = NewView(60, local_map.raw_uv_px, local_map.last_uv_px, np.ones(count, dtype=bool))
    zero = Positions(local_map.ids, np.zeros((count, 3)), np.ones(count))
    local_map.apply(MapUpdate(frames=(NewFrame(6.0, np.eye(4)),), view=view, positions=zero))
    after = snapshot.poses, snapshot.points, snapshot.observations().uv_px
    for was, now in zip(before, after, strict=True):
        np.testing.assert_array_equal(was, now)
    assert snapshot.next_frame == 60 == local_map.next_frame - 1


@pytest.mark.parametrize("frames", [41, 60])
def test_nothing_changes_where_stage_c_changed_nothing(frames):
    problem, _, _, _ = scene(60, disturbed=0.0)
    local_map, refined = map_of(problem, 0, frames - 1), map_of(problem, 0, 39)
    before = local_map.poses.copy(), local_map.points.copy()
    reconciled(refined, local_map)
    np.testing.assert_array_equal(local_map.poses[:40], before[0][:40])
    assert away(local_map.poses, before[0]) < 0.02
    np.testing.assert_allclose(local_map.points, before[1], atol=1e-12)


def test_zero_motions_since_the_snapshot_take_its_scale():
    local_map, refined = grown()
    held = tuple(ZeroMotion(frame, 30, np.eye(4) + np.eye(4, k=3), np.ones(6)) for frame in (38, 45))
    local_map.apply(MapUpdate(zero_motions=held))
    refined.apply(MapUpdate(zero_motions=held[:1]))
    refined.apply(MOVED)
    reconciled(refined, local_map)
    before, after = local_map.zero_motions
    # the snapshot ends at frame 39 and is larger by a tenth
    assert (after.frame, after.reference) == (45, 30)
    np.testing.assert_allclose(after.reference_T_frame[0, 3], 1.1, rtol=1e-6)
    assert before.frame == 38
