"""A camera in a room that looks away and back again; poses, points and pixels are exact."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from room_pipeline import fed
from scipy.spatial.transform import Rotation
from solutions import NORTH_R_CAMERA, make_poses
from textured_room import (
    CAMERA,
    CONFIG,
    FPS,
    LENS,
    followed_map,
    frames,
    image,
    moved,
    path,
    pixels,
)

from vgps.camera import distort
from vgps.evaluation.alignment import align
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView, Positions
from vgps.model import Frame
from vgps.tracking import returning_features
from vgps.tracking.frame_tracker import FrameTracker
from vgps.tracking.reference_patches import ReferencePatches
from vgps.tracking.returning_features import ReturningFeatures
from vgps.tracking.tracking_result import TrackingResult

TRACKING = CONFIG.tracking
POSES = path(4)
AWAY, BACK = moved(POSES[-1], 0.05, (0.0, 90.0, 0.0)), moved(POSES[-1], 0.2)


@pytest.fixture(autouse=True)
def every_view_is_searched(monkeypatch):
    monkeypatch.setattr(returning_features, "_EVERY", 1)


class Walk:
    """A map of exact features, followed in POSES, and the tracker of its camera."""

    def __init__(self, camera=CAMERA, **tracking):
        self.camera = camera
        self.map, self.points = followed_map(POSES, camera)
        self.all_ids = self.map.ids.copy()
        self.map.apply(MapUpdate(more_moving_views=np.full(len(self.map.ids), -3)))
        config = TRACKING.model_copy(update=tracking)
        self.tracker = FrameTracker(camera, config, CONFIG.mapping, np.random.default_rng(0))
        self.patches = self.tracker._patches[self.map] = ReferencePatches(camera)
        self.newest = image(POSES[-1], camera)

    def look(self, pose, followed=(), gray=None, mask=None, posed=True):
        """Add a view in which only some features were followed; return what comes back to it."""
        self.patches.take(self.map, self.newest)  # as stage A does
        uv = pixels(pose, self.points[self.map.ids])
        found, number = np.isin(self.map.ids, followed), self.map.next_frame
        view = NewView(number, np.where(found[:, None], distort(self.camera, uv), 0.0), uv, found)
        self.map.apply(MapUpdate(frames=(NewFrame(number / FPS, pose),), view=view))
        self.newest = image(pose, self.camera) if gray is None else gray
        frame = Frame(number, number / FPS, self.newest, mask)
        sigma = np.full(6, 1e-3) if posed else None  # none if no feature posed the frame
        result = TrackingResult(raw_uv_px=uv, uv_px=uv, found=found, pose_sigma=sigma)
        update = self.tracker.find_returning(self.map, frame, result)
        self.map.apply(update)
        return np.zeros(0, int) if update.returned is None else update.returned.ids


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
def test_features_that_left_the_picture_go_on_as_they_were(camera):
    walk = Walk(camera)
    before = walk.map.views.copy()
    assert len(walk.look(AWAY)) == 0 and len(walk.map.ids) == 0
    back = walk.look(BACK)
    assert len(back) > 0.8 * len(walk.all_ids) and set(back) <= set(walk.all_ids)
    assert np.linalg.norm(walk.map.last_uv_px - pixels(BACK, walk.points[back]), axis=1).max() < 0.5
    np.testing.assert_allclose(distort(camera, walk.map.last_uv_px), walk.map.raw_uv_px, atol=1e-3)
    np.testing.assert_array_equal(walk.map.views[:, -6:-2], before[back, -4:])
    assert np.isnan(walk.map.views[:, -2]).all() and len(walk.look(BACK, followed=back)) == 0


def test_the_track_goes_on_from_its_reference_patch():
    walk = Walk()
    walk.look(AWAY)
    back = walk.look(BACK)
    walk.patches.take(walk.map, walk.newest)
    assert walk.patches.patches.ids.tolist() == back.tolist()
    assert (walk.patches.patches.frame == len(POSES) - 1).all()


def shifted(pixels_right):
    """What the camera sees when it looks back, if everything has moved in the picture."""
    return np.roll(image(BACK), pixels_right, axis=1)


@pytest.mark.parametrize(
    "gray", [image(BACK, seed=1), shifted(5), np.zeros_like(image(BACK))], ids=["other", "moved", "dark"]
)
def test_what_is_not_where_it_was_is_given_up(gray):
    walk = Walk()
    walk.look(AWAY)
    assert len(walk.look(BACK, gray=gray)) < 0.05 * len(walk.all_ids)
    assert len(walk.look(BACK)) == 0


def test_what_lies_a_pixel_off_is_observed_there():
    walk = Walk()
    walk.look(AWAY)
    back = walk.look(BACK, gray=shifted(1))
    expected = pixels(BACK, walk.points[back]) + np.array([1.0, 0.0])
    assert len(back) > 0.7 * len(walk.all_ids)
    assert np.median(np.linalg.norm(walk.map.last_uv_px - expected, axis=1)) < 0.15


def test_features_lost_in_the_picture_do_not_come_back():
    walk = Walk()
    assert len(walk.look(BACK)) == 0  # not followed although the picture shows them
    assert len(walk.look(AWAY)) == len(walk.look(BACK)) == 0


def test_what_moved_on_its_own_does_not_come_back():
    walk = Walk()
    own = walk.all_ids[::2]
    walk.map.apply(MapUpdate(more_moving_views=np.where(np.isin(walk.map.ids, own), 3, 0)))
    walk.look(AWAY)
    back = walk.look(BACK)
    assert len(back) > 0 and not np.isin(back, own).any()


def test_features_that_lost_their_positions_do_not_come_back():
    walk = Walk()
    walk.look(AWAY)
    gone = walk.all_ids[:20]
    none = Positions(gone, np.full((20, 3), np.nan), np.full(20, np.nan))
    walk.map.apply(MapUpdate(positions=none))
    back = walk.look(BACK)
    assert len(back) > 0 and not np.isin(back, gone).any()


@pytest.mark.parametrize(("return_frames", "returns"), [(6, True), (5, False), (0, False)])
def test_they_are_forgotten_after_a_while(return_frames, returns):
    """Their patches are of frame 3, and frame 9 shows them again."""
    walk = Walk(return_frames=return_frames)
    for _ in range(5):
        walk.look(AWAY)
    assert (len(walk.look(BACK)) > 0) == returns


def test_they_wait_behind_a_mask_and_where_no_feature_posed_the_frame():
    walk = Walk()
    walk.look(AWAY)
    left = np.ones((CAMERA.height, CAMERA.width), bool)
    left[:, CAMERA.width // 2 :] = False
    assert len(walk.look(BACK, posed=False)) == 0
    first = walk.look(BACK, mask=left)
    assert (walk.map.raw_uv_px[:, 0] < CAMERA.width // 2).all()
    second = walk.look(BACK, followed=first)
    assert min(len(first), len(second)) > 10 and not np.isin(second, first).any()


def test_no_more_features_are_followed_than_wanted():
    walk = Walk(max_features=30, min_returning=10)
    walk.look(AWAY)
    first = walk.look(BACK)
    assert 20 < len(first) <= 30
    assert 0 < len(walk.look(BACK, followed=first[:10])) <= 20


def left_ids(walk):
    """Features that wait to come back."""
    ((_, left),) = walk.tracker.state([walk.map])["left"]
    return np.concatenate([part.ids for part in left[0]])


def test_every_third_view_is_searched(monkeypatch):
    monkeypatch.undo()
    walk = Walk()
    counts = [len(walk.look(pose)) for pose in [AWAY] * 3 + [BACK] * 3]
    assert counts[:5] == [0] * 5 and counts[5] > 0.8 * len(walk.all_ids)


def test_they_wait_while_fewer_are_in_view_than_come_back():
    walk, few = Walk(), Walk(min_returning=1000)
    walk.look(AWAY)
    few.look(AWAY)
    waiting = left_ids(few)
    assert len(few.look(BACK)) == 0 < len(walk.look(BACK))
    np.testing.assert_array_equal(left_ids(few), waiting)


def test_they_wait_while_fewer_are_found_than_come_back():
    whole = Walk()
    whole.look(AWAY)
    half = image(BACK)
    half[:, : CAMERA.width // 2] = 0
    walk = Walk(min_returning=int(0.8 * len(whole.look(BACK))))
    walk.look(AWAY)
    before = left_ids(walk)
    assert len(walk.look(BACK, gray=half)) == 0
    u = pixels(BACK, walk.points[before])[:, 0]
    after = left_ids(walk)  # those in the dark half are given up
    assert 10 < len(after) < len(before) - 10
    assert u[np.isin(before, after)].min() > CAMERA.width // 2 - 10


def test_a_restored_tracker_finds_the_same():
    walk, again = Walk(), Walk()
    walk.look(AWAY)
    again.look(AWAY)
    ((_, left),) = walk.tracker.state([walk.map])["left"]
    again.tracker._returning = ReturningFeatures(CAMERA, TRACKING)
    again.tracker.restore(walk.tracker.state([]) | {"left": [(again.map, deepcopy(left))]})
    back = walk.look(BACK)
    assert len(back) > 0
    np.testing.assert_array_equal(again.look(BACK), back)


def test_they_are_known_after_older_features_were_discarded():
    whole, walk = Walk(), Walk()
    whole.look(AWAY)
    walk.look(AWAY)
    walk.map._features.drop_first(30)
    walk.map.discarded_features += 30
    walk.points = walk.points[30:]
    back = walk.look(BACK)
    assert back.tolist() == [number - 30 for number in whole.look(BACK) if number >= 30]
    assert np.linalg.norm(walk.map.last_uv_px - pixels(BACK, walk.points[back]), axis=1).max() < 0.5


def test_a_rolling_shutter_shows_them_elsewhere(monkeypatch):
    walk = Walk(replace(CAMERA, readout_s=0.05))
    walk.look(AWAY)
    turning = moved(BACK, 0.0, (0.0, -4.0, 0.0))
    walk.look(turning, gray=np.zeros_like(image(BACK)), posed=False)
    starts = []
    whole = ReferencePatches.align

    def spied(self, *args):
        starts.append((self.patches.ids, args[3]))
        return whole(self, *args)

    monkeypatch.setattr(ReferencePatches, "align", spied)
    walk.look(BACK)
    ids, start = starts[0]
    share = start[:, 1] / (CAMERA.height - 1) - 0.5
    # four degrees in 0.1 s, half of it in a readout: from the first row to the last by 2 degrees
    shift = (start - pixels(BACK, walk.points[ids]))[:, 0]
    expected = -share * CAMERA.fx * np.radians(2.0)
    assert np.ptp(expected) > 5.0
    np.testing.assert_allclose(shift, expected, atol=0.2 * np.ptp(expected))


def looking_around(count):
    """A camera that moves slowly through the room and pans by 35 degrees to either side."""
    t = np.arange(count)
    turn = np.column_stack([35 * np.sin(2 * np.pi * t / 40), np.sin(t / 4), np.sin(t / 5)])
    rotations = NORTH_R_CAMERA @ Rotation.from_euler("yxz", turn, degrees=True).as_matrix()
    positions = np.column_stack([0.4 * np.sin(t / 9), 0.02 * t, 0.1 * np.sin(t / 7)])
    return make_poses(positions, rotations)


def gaps(local_map):
    """Features that were observed, not observed, and observed again."""
    seen = local_map.observations()
    order = np.lexsort((seen.frame, seen.landmark))
    landmark, frame = seen.landmark[order], seen.frame[order]
    return np.unique(landmark[1:][(np.diff(landmark) == 0) & (np.diff(frame) > 1)])


@pytest.mark.slow
def test_a_panning_camera_drifts_less(monkeypatch):
    monkeypatch.undo()
    true = looking_around(80)
    seen = list(frames(true))
    errors = {120: [], 0: []}
    for return_frames, found in errors.items():
        for seed in range(3):
            update = {"return_frames": return_frames, "min_returning": 12}  # of 150 features
            tracking = CONFIG.tracking.model_copy(update=update)
            config = CONFIG.model_copy(update={"tracking": tracking, "seed": seed})
            (local_map,) = fed(seen, config=config).maps
            first = local_map.first_posed
            _, off = align(local_map.poses[first:, :3, 3], true[first:, :3, 3], with_scale=True)
            found.append(float(np.sqrt(np.mean(np.sum(off**2, axis=1)))))
            assert (len(gaps(local_map)) > 50) == (return_frames > 0)
    assert np.median(errors[120]) < 0.7 * np.median(errors[0])
