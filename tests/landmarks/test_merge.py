from dataclasses import replace

import numpy as np
import pytest
from synthetic_landmarks import random_contents

from vgps.errors import LandmarkDatabaseError
from vgps.geodesy import to_enu, to_geodetic
from vgps.landmarks.merge import merge
from vgps.model import GeodeticPoint

ELSEWHERE = GeodeticPoint(49.03, 8.36, 120.0)


def test_another_origin_moves_everything_and_no_distance() -> None:
    one, other = random_contents(1), replace(random_contents(2), world_origin=ELSEWHERE)
    both = merge([one, other])
    assert both.world_origin == one.world_origin
    n = len(one.views)
    for name in ("world_p_landmark", "world_p_camera"):
        geodetic = to_geodetic(ELSEWHERE, getattr(other.views, name))
        np.testing.assert_allclose(
            getattr(both.views, name)[n:], to_enu(one.world_origin, *geodetic.T), atol=1e-5
        )
        np.testing.assert_array_equal(getattr(both.views, name)[:n], getattr(one.views, name))
    tip = other.views.world_p_landmark + 1e3 * other.views.world_v_column
    moved_tip = both.views.world_p_landmark[n:] + 1e3 * both.views.world_v_column[n:]
    np.testing.assert_allclose(moved_tip, to_enu(one.world_origin, *to_geodetic(ELSEWHERE, tip).T), atol=1e-5)


def test_keyframes_go_with_their_landmarks() -> None:
    one, other = random_contents(1), replace(random_contents(2), world_origin=ELSEWHERE)
    both = merge([one, other])
    assert len(both.keyframes) == len(one.keyframes) + len(other.keyframes)
    for moved, key in zip(both.keyframes[len(one.keyframes) :], other.keyframes, strict=True):
        rows = [np.flatnonzero(both.views.landmark == landmark)[0] for landmark in moved.landmark]
        np.testing.assert_allclose(moved.world_p_landmark, both.views.world_p_landmark[rows], atol=1e-9)
        rotation = moved.world_T_camera[:3, :3]
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
        seen = (key.world_p_landmark - key.world_T_camera[:3, 3]) @ key.world_T_camera[:3, :3]
        seen_now = (moved.world_p_landmark - moved.world_T_camera[:3, 3]) @ rotation
        np.testing.assert_allclose(seen_now, seen, atol=1e-9)


def test_ids_stay_unique_and_grouped() -> None:
    parts = [random_contents(seed) for seed in range(3)]
    both = merge(parts)
    counts = [np.unique(part.views.landmark, return_counts=True)[1] for part in parts]
    np.testing.assert_array_equal(
        np.unique(both.views.landmark, return_counts=True)[1], np.concatenate(counts)
    )
    assert (np.diff(both.views.landmark) >= 0).all()
    assert [source.landmarks for source in both.sources] == [60, 60, 60]


def test_one_alone_stays_as_it_is() -> None:
    contents = replace(random_contents(), world_origin=None)
    assert merge([contents]).world_origin is None
    np.testing.assert_array_equal(merge([contents]).views.landmark, contents.views.landmark)


def test_what_cannot_be_joined_is_said() -> None:
    one = random_contents()
    with pytest.raises(LandmarkDatabaseError, match="without a world origin"):
        merge([one, replace(one, world_origin=None)])
    small = replace(one.views, templates=one.views.templates[:, :2, :3, :3])
    with pytest.raises(
        LandmarkDatabaseError, match="2 levels of 3 pixels and of 3 levels of 5 pixels; expected one size"
    ):
        merge([one, replace(one, views=small)])
