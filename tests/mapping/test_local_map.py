import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from synthetic_map import map_of, no_positions, scene

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import (
    MapUpdate,
    NewFeatures,
    NewFrame,
    NewView,
    Positions,
    ReturnedFeatures,
    Similarity,
)
from vgps.mapping.zero_motion import ZeroMotion

HISTORY = 5


def walked(frames, rng, lost_share=0.2):
    """A map whose features come and go; a pixel is the frame and a number of the feature."""
    made = LocalMap(0, HISTORY)
    for frame in range(frames):
        pose = np.eye(4)
        pose[0, 3] = frame
        found = rng.random(len(made.ids)) > lost_share
        uv = np.stack([np.full(len(made.ids), float(frame)), made.raw_uv_px[:, 1]], axis=1)
        view = NewView(frame, uv, uv, found)
        made.apply(MapUpdate(frames=(NewFrame(float(frame), pose),), view=view, renew_full_tracks=True))
        new = np.stack([np.full(40, float(frame)), made.feature_count + np.arange(40.0)], axis=1)
        made.apply(MapUpdate(features=NewFeatures(new, new, np.full(40, frame % 256, dtype=np.uint8))))
        points = np.stack([new[:, 1]] * 3, axis=1)
        made.apply(MapUpdate(positions=Positions(made.ids[-40:], points, np.full(40, 0.5))))
    return made


def observations(made, since):
    """Frame, pixel, position and luminance of every observation, which do not depend on ids."""
    log = made.observations(since)
    return np.column_stack([log.frame, log.uv_px, made.points[log.landmark], made.gray[log.landmark]])


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(st.integers(10, 40), st.integers(0, 45), st.integers(0, 45), st.integers(0, 3))
def test_discarding_leaves_the_rest_as_it_was(frames, before_frame, before_view, seed):
    whole, cut = (walked(frames, np.random.default_rng(seed)) for _ in range(2))
    old = cut.discard_before(before_frame, before_view)
    since = min(before_view, frames - 1)
    assert cut.first_frame == min(before_frame, since) and cut.next_frame == frames
    np.testing.assert_array_equal(np.concatenate([old, cut.poses]), whole.poses)
    np.testing.assert_array_equal(observations(cut, 0), observations(whole, since))
    np.testing.assert_array_equal(cut.points[cut.ids], whole.points[whole.ids])
    np.testing.assert_array_equal(cut.last_uv_px, whole.last_uv_px)
    poses, valid = cut.view_poses()
    assert valid[-1] and poses[-1, 0, 3] == frames - 1
    np.testing.assert_array_equal(np.isfinite(cut.views[..., 0]) & ~valid, False)


def observed(made, ids, returned=()):
    """Add a view in which only some features are followed on, and some return; a pixel is the frame."""
    frame = made.next_frame
    found = np.isin(made.ids, ids)
    uv = np.full((len(made.ids), 2), float(frame))
    view = NewView(frame, uv, uv, found)
    uv = np.full((len(returned), 2), float(frame))
    back = ReturnedFeatures(np.array(returned, dtype=np.int64), uv, uv)
    made.apply(
        MapUpdate(
            frames=(NewFrame(float(frame), np.eye(4)),), view=view, returned=back, renew_full_tracks=True
        )
    )


def test_a_feature_that_returns_continues_its_track_with_a_gap():
    made = LocalMap(0, HISTORY)
    observed(made, [])
    made.apply(MapUpdate(features=NewFeatures(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros(3, np.uint8))))
    observed(made, [0, 1, 2])
    observed(made, [1])
    observed(made, [1], returned=[2, 0])
    assert made.ids.tolist() == [1, 2, 0] and made.raw_uv_px[:, 0].tolist() == [3.0] * 3
    none = np.nan
    np.testing.assert_array_equal(made.views[..., 0], [[none, 0, 1, 2, 3], *[[none, 0, 1, none, 3]] * 2])
    log = made.observations()
    assert log.frame[log.landmark == 0].tolist() == [0, 1, 3]


def test_a_track_with_a_gap_is_renewed_once_it_is_as_long_as_the_history():
    made = LocalMap(0, HISTORY)
    observed(made, [])
    made.apply(MapUpdate(features=NewFeatures(np.zeros((1, 2)), np.zeros((1, 2)), np.zeros(1, np.uint8))))
    observed(made, [])
    observed(made, [], returned=[0])
    for _ in range(3):
        observed(made, [0])
    assert made.ids.tolist() == [0]
    observed(made, [0])  # the fifth view in succession
    assert made.ids.tolist() == [1]


def test_ids_are_lowered_by_hundreds_and_memory_is_released():
    made = walked(60, np.random.default_rng(0))
    before, count = made.ids.copy(), made.feature_count
    made.discard_before(40, 50)
    moved = np.unique(before - made.ids)
    assert len(moved) == 1 and moved[0] % 100 == 0 and moved[0] > 1000
    assert made.feature_count == count - moved[0]


def test_old_zero_motions_and_bridged_frames_are_discarded():
    made = walked(30, np.random.default_rng(0))
    held = (ZeroMotion(frame, frame - 1, np.eye(4), np.ones(6)) for frame in (5, 15, 25))
    bridged = tuple(NewFrame(float(frame), np.eye(4), frame in {31, 33}) for frame in range(30, 35))
    made.apply(MapUpdate(zero_motions=tuple(held), frames=bridged))
    assert made.bridged == {31, 33} and np.flatnonzero(~made.moving).tolist() == [5, 15, 25]
    made.discard_before(10, 20)
    assert made.bridged == {31, 33} and [motion.frame for motion in made.zero_motions] == [15, 25]
    assert made.first_frame == 10 and np.flatnonzero(~made.moving).tolist() == [5, 15]


def test_frames_that_stand_do_not_count_among_the_last_ones():
    made = walked(30, np.random.default_rng(0))
    assert made.last_moving(10) == 20 and made.last_moving(50) == 0
    made.apply(MapUpdate(zero_motions=tuple(ZeroMotion(k, 11, np.eye(4), np.ones(6)) for k in range(12, 22))))
    assert made.last_moving(8) == 22 and made.last_moving(10) == 10


def test_a_map_grows_on_after_nearly_everything_was_discarded():
    rng = np.random.default_rng(1)
    made = walked(30, rng)
    made.discard_before(28, 28)
    for _ in range(200):
        features = NewFeatures(np.zeros((50, 2)), np.zeros((50, 2)), np.zeros(50, dtype=np.uint8))
        made.apply(MapUpdate(features=features))
    assert len(made.points) == made.feature_count and np.isnan(made.points[-1]).all()


def test_odometry_stays_as_it_was_tracked_when_poses_change():
    rng = np.random.default_rng(0)
    made = LocalMap(0, HISTORY)
    unknown, centres = np.full((4, 4), np.nan), rng.normal(size=(5, 3))
    rotations = Rotation.from_rotvec(rng.normal(size=(5, 3))).as_matrix()
    made.apply(MapUpdate(frames=(NewFrame(0.0, unknown),)))
    for R, p in zip(rotations, centres, strict=True):
        pose = np.block([[R, p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
        frame = NewFrame(float(made.next_frame), pose)
        view = NewView(made.next_frame, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=bool))
        made.apply(MapUpdate(frames=(frame,), view=view))
    seen = np.einsum("fji,fj->fi", rotations[:-1], np.diff(centres, axis=0))
    assert np.isnan(made.odometry[:2]).all()
    np.testing.assert_allclose(made.odometry[2:], seen)
    made.apply(MapUpdate(first_frame=3, poses=made.poses[3:] + np.eye(4)))
    later = made.snapshot()
    to_world = Similarity(2.0, Rotation.from_euler("z", 0.5).as_matrix(), np.ones(3))
    later.apply(MapUpdate(similarity=to_world))
    np.testing.assert_allclose(later.odometry[2:], 2.0 * seen)
    np.testing.assert_allclose(made.odometry[2:], seen)
    made.discard_before(3, 3)
    np.testing.assert_allclose(made.odometry, seen[1:])


@pytest.mark.parametrize("name", ["poses", "t_s", "points", "sigma_px", "odometry", "bending"])
def test_arrays_are_read_only(name):
    made = walked(5, np.random.default_rng(0))
    with pytest.raises(ValueError, match="read-only"):
        getattr(made, name)[:] = 0.0


def test_an_update_changes_what_it_names_and_nothing_else():
    made, rng = walked(12, np.random.default_rng(0)), np.random.default_rng(1)
    before = made.snapshot()
    new = rng.normal(size=(4, 4, 4))
    made.apply(MapUpdate(first_frame=5, poses=new, positions=no_positions(made.ids[:3])))
    np.testing.assert_array_equal(made.poses[5:9], new)
    np.testing.assert_array_equal(made.poses[:5], before.poses[:5])
    np.testing.assert_array_equal(made.poses[9:], before.poses[9:])
    assert np.isnan(made.points[made.ids[:3]]).all() and not made.positioned[:3].any()
    np.testing.assert_array_equal(made.points[made.ids[3:]], before.points[before.ids[3:]])
    np.testing.assert_array_equal(made.views, before.views)
    assert not made.aligned


def test_the_bending_of_a_path_stays_where_stage_c_says_nothing():
    made = walked(6, np.random.default_rng(0))
    assert np.isnan(made.bending).all()
    nothing = np.nan
    made.apply(MapUpdate(poses=made.poses.copy(), bending=np.array([nothing, 1, 2, 3, nothing, nothing])))
    later = np.array([nothing, 4, 5, nothing])
    made.apply(MapUpdate(first_frame=2, poses=made.poses[2:].copy(), bending=later))
    made.apply(MapUpdate(poses=made.poses.copy()))
    expected = np.array([nothing, 1, 2, 4, 5, nothing])
    np.testing.assert_array_equal(made.bending, expected)
    np.testing.assert_array_equal(made.snapshot().bending, expected)
    made.discard_before(2, 2)
    np.testing.assert_array_equal(made.bending, expected[2:])


def test_a_similarity_moves_poses_points_and_constraints_alike():
    made = walked(6, np.random.default_rng(0))
    held = ZeroMotion(4, 3, np.eye(4) + np.eye(4, k=3), np.ones(6))
    made.apply(MapUpdate(zero_motions=(held,)))
    before, R = made.snapshot(), Rotation.from_euler("z", 90, degrees=True).as_matrix()
    made.apply(MapUpdate(similarity=Similarity(2.0, R, np.array([1.0, 0.0, 0.0])), aligned=True))
    # frame 3 stood at x = 3: doubled to 6, rotated to y, then one metre east
    np.testing.assert_allclose(made.poses[3, :3, 3], [1.0, 6.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(made.points[7], 2.0 * R @ before.points[7] + [1.0, 0.0, 0.0])
    (scaled,) = made.zero_motions
    assert scaled.reference_T_frame[0, 3] == 2.0 and scaled.sigma.tolist() == [1, 1, 1, 2, 2, 2]
    assert made.aligned and not before.aligned


@pytest.mark.slow
def test_observations_of_another_calibration_leave_a_snapshot_as_it_was():
    problem, _, _, _ = scene(frames=6)
    local_map = map_of(problem, 0, 5)
    kept, raw = local_map.snapshot(), local_map.raw_uv_px.copy()
    views, logged = local_map.views.copy(), local_map.observations().uv_px
    local_map.apply(MapUpdate(undistorted=lambda uv_px: uv_px + np.array([1.0, 2.0])))
    np.testing.assert_array_equal(local_map.views, views + np.array([1.0, 2.0]))
    np.testing.assert_array_equal(local_map.observations().uv_px, logged + np.array([1.0, 2.0]))
    np.testing.assert_array_equal(local_map.raw_uv_px, raw)
    np.testing.assert_array_equal(kept.views, views)
    np.testing.assert_array_equal(kept.observations().uv_px, logged)
