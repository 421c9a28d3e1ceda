import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import ZeroMotion

HISTORY = 5


def walked(frames, rng, lost_share=0.2):
    """A map whose features come and go, observations named by frame and a number of their own."""
    made = LocalMap(0, HISTORY)
    for frame in range(frames):
        pose = np.eye(4)
        pose[0, 3] = frame
        made.append_pose(pose)
        found = rng.random(len(made.ids)) > lost_share
        uv = np.stack([np.full(len(made.ids), float(frame)), made.raw_uv_px[:, 1]], axis=1)
        made.push_view(frame, uv, uv, found)
        made.renew_full_tracks()
        new = np.stack([np.full(40, float(frame)), made.feature_count + np.arange(40.0)], axis=1)
        made.add_features(new, new, np.full(40, frame % 256, dtype=np.uint8))
        fresh = made.ids[-40:]
        made.set_points(fresh, np.stack([new[:, 1]] * 3, axis=1), np.full(40, 0.5))
    return made


def observations(made, since):
    """Frame, place in the image, position and luminance of every observation: what does not depend on ids."""
    log = made.observations(since)
    return np.column_stack([log.frame, log.uv_px, made.points[log.landmark], made.gray[log.landmark]])


@settings(deadline=None, max_examples=30)
@given(st.integers(10, 40), st.integers(0, 45), st.integers(0, 45), st.integers(0, 3))
def test_forgetting_leaves_the_rest_as_it_was(frames, before_frame, before_view, seed):
    whole, cut = (walked(frames, np.random.default_rng(seed)) for _ in range(2))
    old = cut.forget(before_frame, before_view)
    since = min(before_view, frames - 1)
    assert cut.first_frame == min(before_frame, since) and cut.next_frame == frames
    np.testing.assert_array_equal(np.concatenate([old, cut.poses]), whole.poses)
    np.testing.assert_array_equal(observations(cut, 0), observations(whole, since))
    np.testing.assert_array_equal(cut.points[cut.ids], whole.points[whole.ids])
    np.testing.assert_array_equal(cut.last_uv_px, whole.last_uv_px)
    poses, valid = cut.view_poses()
    assert valid[-1] and poses[-1, 0, 3] == frames - 1
    np.testing.assert_array_equal(np.isfinite(cut.views[..., 0]) & ~valid, False)


def test_ids_move_by_round_numbers_and_memory_is_given_back():
    made = walked(60, np.random.default_rng(0))
    before, count = made.ids.copy(), made.feature_count
    made.forget(40, 50)
    moved = np.unique(before - made.ids)
    assert len(moved) == 1 and moved[0] % 100 == 0 and moved[0] > 1000
    assert made.feature_count == count - moved[0]


def test_ties_and_bridged_frames_of_long_ago_go():
    made = walked(30, np.random.default_rng(0))
    made.bridged = {3, 20}
    made.zero_motions = [ZeroMotion(frame, frame - 1, np.eye(4), np.ones(6)) for frame in (5, 15, 25)]
    made.forget(10, 20)
    assert made.bridged == {20} and [tie.frame for tie in made.zero_motions] == [25]


def test_a_map_goes_on_growing_after_it_forgot_nearly_everything():
    rng = np.random.default_rng(1)
    made = walked(30, rng)
    made.forget(28, 28)
    for _ in range(200):
        made.add_features(np.zeros((50, 2)), np.zeros((50, 2)), np.zeros(50, dtype=np.uint8))
    assert len(made.points) == made.feature_count and np.isnan(made.points[-1]).all()


def test_steps_stay_as_they_were_seen_when_poses_are_changed():
    rng = np.random.default_rng(0)
    made = LocalMap(0, HISTORY)
    unknown, centres = np.full((4, 4), np.nan), rng.normal(size=(5, 3))
    turned = Rotation.from_rotvec(rng.normal(size=(5, 3))).as_matrix()
    made.append_pose(unknown)
    for R, p in zip(turned, centres, strict=True):
        made.append_pose(np.block([[R, p[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]))
        made.push_view(made.next_frame - 1, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=bool))
    seen = np.einsum("fji,fj->fi", turned[:-1], np.diff(centres, axis=0))
    assert np.isnan(made.steps[:2]).all()
    np.testing.assert_allclose(made.steps[2:], seen)
    made.poses[3:, :3, 3] += 1.0
    later = made.snapshot()
    later.transform(2.0, Rotation.from_euler("z", 0.5).as_matrix(), np.ones(3))
    np.testing.assert_allclose(later.steps[2:], 2.0 * seen)
    np.testing.assert_allclose(made.steps[2:], seen)
    made.forget(3, 3)
    np.testing.assert_allclose(made.steps, seen[1:])
