from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import away, map_of, scene

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.fixes import Fixes
from vgps.mapping.zero_motion import ZeroMotion
from vgps.smoothing.merge_maps import merge_maps
from vgps.solution import FrameState

CONFIG = Config()
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def two_maps(aligned=(True, True)):
    """Frames 0-27 and 32-59 of a drive; a map that is not aligned lies elsewhere, at another scale."""
    problem, true, t_s, fixes = scene(disturbed=0.0)
    maps = [map_of(problem, 0, 27), map_of(problem, 32, 59)]
    for made, placed in zip(maps, aligned, strict=True):
        if not placed:
            made.transform(0.2, TURN, np.array([5.0, 5.0, 5.0]))
            made.aligned = False
    return maps, true, t_s, fixes


def test_frames_between_two_maps_are_bridged():
    maps, true, t_s, fixes = two_maps()
    joined = merge_maps(maps, t_s, fixes, ANTENNA, CONFIG)
    assert [k for k, state in enumerate(joined.state) if state is FrameState.BRIDGED] == [28, 29, 30, 31]
    assert away(joined.scene.poses, true) < 0.1
    assert np.bincount(joined.scene.observations.frame, minlength=60)[28:32].sum() == 0
    assert joined.georeferenced and joined.warnings == ()


def test_a_map_without_a_place_finds_it_by_its_own_fixes():
    maps, true, t_s, fixes = two_maps((True, False))
    joined = merge_maps(maps, t_s, fixes, ANTENNA, CONFIG)
    assert away(joined.scene.poses[32:], true[32:]) < 0.3


def test_without_fixes_of_its_own_it_continues_its_neighbour_and_that_is_told():
    maps, true, t_s, fixes = two_maps((True, False))
    early = fixes.where(fixes.t_s < 2.5)
    joined = merge_maps(maps, t_s, early, ANTENNA, CONFIG)
    assert away(joined.scene.poses[32:36], true[32:36]) < 0.5
    assert "too few fixes of their own" in joined.warnings[0]


def test_nothing_to_align_with_is_an_error_and_no_fix_at_all_a_warning():
    maps, _, t_s, fixes = two_maps((False, False))
    near = fixes.where(fixes.t_s < 0.5)
    with pytest.raises(GeometryError, match="too little for scale and heading"):
        merge_maps(maps, t_s, near, ANTENNA, CONFIG)
    maps, _, t_s, _ = two_maps((False, False))
    joined = merge_maps(maps, t_s, Fixes.none(), ANTENNA, CONFIG)
    assert not joined.georeferenced and "no fix ties" in joined.warnings[0]
    assert np.isfinite(joined.scene.poses).all()


def test_a_frame_that_stood_before_the_map_began_stands_where_its_view_does():
    maps, _, t_s, fixes = two_maps()
    maps[0].poses[1] = np.nan
    maps[0].zero_motions.append(ZeroMotion(1, 0, np.eye(4), np.ones(6)))
    joined = merge_maps(maps, t_s, fixes, ANTENNA, CONFIG)
    np.testing.assert_allclose(joined.scene.poses[1], joined.scene.poses[0])


def test_fixes_that_contradict_the_maps_bend_them():
    maps, true, t_s, fixes = two_maps()
    for made in maps:
        made.transform(1.1, np.eye(3), np.zeros(3))
    joined = merge_maps(maps, t_s, fixes, ANTENNA, CONFIG)
    assert away(joined.scene.poses, true) < 0.4
    judged = replace(fixes, used=np.ones(len(fixes), dtype=bool))
    assert not joined.assessment.rejected.any() and len(judged) == len(joined.assessment.own)
