"""Pieces of a scene, compared with what the scene holds there."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_map import map_of, scene

from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.mapping.zero_motion import ZeroMotion
from vgps.smoothing.scene.rig_views import RigViews
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.scene.scene_part import SceneParts

FIRST, LAST = 10, 19


@pytest.fixture(scope="module")
def whole():
    problem, poses, _, _ = scene()
    made, _ = scene_of_map(map_of(problem, 0, len(poses) - 1), 0, NO_CONTROL_OBSERVATIONS)
    return made


def rows_of(observations):
    """Observations as rows, whatever their order."""
    columns = observations.frame, observations.landmark, *observations.uv_px.T
    return sorted(zip(*(column.tolist() for column in columns), strict=True))


def test_a_part_holds_its_frames_and_what_two_of_them_see(whole):
    part, ids = SceneParts(whole).between(FIRST, LAST)
    np.testing.assert_array_equal(part.t_s, whole.t_s[FIRST : LAST + 1])
    np.testing.assert_array_equal(part.poses, whole.poses[FIRST : LAST + 1])
    np.testing.assert_array_equal(part.points, whole.points[ids])
    seen = whole.observations
    expected = [
        row
        for row in rows_of(seen)
        if FIRST <= row[0] <= LAST
        and np.sum((seen.landmark == row[1]) & (seen.frame >= FIRST) & (seen.frame <= LAST)) > 1
    ]
    back = replace(
        part.observations, frame=part.observations.frame + FIRST, landmark=ids[part.observations.landmark]
    )
    assert rows_of(back) == expected
    assert len(ids) < len(whole.points)


def test_the_order_of_the_observations_does_not_matter(whole):
    order = np.random.default_rng(0).permutation(len(whole.observations.frame))
    shuffled = replace(whole, observations=whole.observations.rows(order))
    ours, ids = SceneParts(shuffled).between(FIRST, LAST)
    theirs, expected = SceneParts(whole).between(FIRST, LAST)
    np.testing.assert_array_equal(ids, expected)
    assert rows_of(ours.observations) == rows_of(theirs.observations)


def test_what_ties_places_far_apart_is_left_out(whole):
    loop = np.full(len(whole.observations.frame), -1)
    loop[whole.observations.frame == 12] = 3
    part, _ = SceneParts(replace(whole, loop=loop)).between(FIRST, LAST)
    assert part.loop is None and not np.any(part.observations.frame == 12 - FIRST)


def test_standing_frames_and_the_cameras_of_a_rig_keep_their_places(whole):
    held = [ZeroMotion(frame, frame - 1, np.eye(4), np.ones(6)) for frame in (FIRST, 15, LAST + 1)]
    camera = np.arange(len(whole.points)) % 2
    delay_s = np.stack([np.zeros(len(whole.t_s)), 0.001 * np.arange(len(whole.t_s))])
    rates = np.arange(3.0 * len(whole.t_s)).reshape(-1, 3)
    rig = replace(whole, zero_motions=tuple(held), rig=RigViews(camera, delay_s), rates=rates)
    part, ids = SceneParts(rig).between(FIRST, LAST)
    assert [(one.frame, one.reference) for one in part.zero_motions] == [(5, 4)]
    np.testing.assert_array_equal(part.rig.camera, camera[ids])
    np.testing.assert_array_equal(part.rig.delay_s, delay_s[:, FIRST : LAST + 1])
    np.testing.assert_array_equal(part.rates, rates[FIRST : LAST + 1])


def test_frames_that_see_nothing_have_no_landmarks(whole):
    blind = whole.with_observations(whole.observations.frame < FIRST)
    part, ids = SceneParts(blind).between(FIRST, LAST)
    assert len(ids) == 0 and len(part.poses) == 10
