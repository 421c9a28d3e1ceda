import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import away, context, map_of, moved, scene

from vgps.config import Config
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.map_update import MapUpdate, Similarity
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FixClass
from vgps.smoothing.merging.merge_maps import merge_maps
from vgps.solution import FrameState

CONFIG = Config()
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def two_maps(aligned=(True, True), last=27):
    """Frames 0 to ``last`` and 32-59 of a drive; a map not aligned lies elsewhere, at another scale."""
    problem, true, t_s, fixes = scene(disturbed=0.0)
    maps = [
        map_of(problem, begin, end, aligned=placed)
        for begin, end, placed in zip((0, 32), (last, 59), aligned, strict=True)
    ]
    elsewhere = Similarity(0.2, TURN, np.array([5.0, 5.0, 5.0]))
    for made in maps:
        if not made.aligned:
            made.apply(MapUpdate(similarity=elsewhere))
    return maps, true, t_s, fixes


def merged(maps, t_s, fixes, time_offset_s=0.0):
    """The merged maps; the maps themselves are checked to stay as they were."""
    before = [local_map.poses.copy() for local_map in maps]
    found = merge_maps(maps, t_s, fixes, Sensors.fixed(ANTENNA, time_offset_s), context(CONFIG))
    for local_map, poses in zip(maps, before, strict=True):
        np.testing.assert_array_equal(local_map.poses, poses)
    return found


def test_frames_between_two_maps_are_bridged():
    maps, true, t_s, fixes = two_maps()
    found = merged(maps, t_s, fixes)
    assert [k for k, state in enumerate(found.state) if state is FrameState.BRIDGED] == [28, 29, 30, 31]
    assert away(found.scene.poses, true) < 0.1
    assert np.bincount(found.scene.observations.frame, minlength=60)[28:32].sum() == 0
    assert found.georeferenced and found.warnings == ()


def test_an_unaligned_map_is_aligned_with_its_fixes():
    maps, true, t_s, fixes = two_maps((True, False))
    found = merged(maps, t_s, fixes)
    assert away(found.scene.poses[32:], true[32:]) < 0.3


@pytest.mark.slow
def test_an_unaligned_map_is_aligned_by_the_corrected_clock_of_its_fixes():
    maps, _, t_s, fixes = two_maps((True, False))
    late = replace(fixes, t_s=fixes.t_s + 0.5)
    right, found = merged(maps, t_s, fixes), merged(maps, t_s, late, 0.5)
    np.testing.assert_allclose(found.scene.poses, right.scene.poses, atol=1e-6)


def test_a_map_without_fixes_continues_its_neighbour_with_a_warning():
    maps, true, t_s, fixes = two_maps((True, False))
    early = fixes.where(fixes.t_s < 2.5)
    found = merged(maps, t_s, early)
    assert away(found.scene.poses[32:36], true[32:36]) < 0.5
    assert "too few fixes to align" in found.warnings[0]


@pytest.mark.parametrize("continued", [None, 0, 1])
def test_maps_that_meet_keep_all_that_they_saw(continued):
    """Whether fixes align both of them or one continues the other."""
    maps, _, t_s, fixes = two_maps((continued != 0, continued != 1), last=31)
    held = [ZeroMotion(frame, frame - 1, np.eye(4), np.ones(6)) for frame in (31, 33)]
    for local_map, one in zip(maps, held, strict=True):
        local_map.apply(MapUpdate(zero_motions=(one,)))
    inside = {None: fixes.t_s > 0, 0: fixes.t_s > 3.5, 1: fixes.t_s < 2.5}[continued]
    found = merged(maps, t_s, fixes.where(inside))
    assert len(found.warnings) == (continued is not None)
    assert all("too few fixes to align" in warning for warning in found.warnings)
    assert not found.scene.unseen.any() and FrameState.BRIDGED not in found.state
    assert [one.frame for one in found.scene.zero_motions] == [31, 33]
    assert np.flatnonzero(found.scene.torn(1)).tolist() == [31]


@pytest.mark.slow
def test_fixes_that_do_not_determine_the_scale_align_with_a_warning():
    """Two single fixes on a path straight up, which has no heading."""
    maps, true, t_s, fixes = two_maps((False, False))
    single = replace(fixes, fix_class=np.full(len(fixes), CLASSES.index(FixClass.SINGLE)))
    found = merged(maps, t_s, single.where(single.t_s < 0.5))
    assert found.georeferenced and np.isfinite(found.scene.poses).all()
    assert away(found.scene.poses[:5], true[:5]) < 1.0
    expected = r"only 2 fixes tie.*standard deviations of scale \d+%, heading unknown, tilt \d+ degrees"
    assert re.search(expected, found.warnings[0])


def test_a_run_whose_fixes_lie_outside_its_maps_is_not_in_the_world():
    maps, _, t_s, fixes = two_maps((False, False))
    between = fixes.where((fixes.t_s > 2.75) & (fixes.t_s < 3.15))
    found = merged(maps, t_s, between)
    assert len(between) and not found.georeferenced and "no two fixes lie where" in found.warnings[0]
    found = merged(maps, t_s, Fixes.empty())
    assert not found.georeferenced and "no fix or control point ties" in found.warnings[0]
    assert np.isfinite(found.scene.poses).all()


def test_a_standing_frame_before_the_start_has_the_pose_of_its_view():
    maps, _, t_s, fixes = two_maps()
    moved(maps[0], 1, lambda poses: np.concatenate([np.full((1, 4, 4), np.nan), poses[1:]]))
    maps[0].apply(MapUpdate(zero_motions=(ZeroMotion(1, 0, np.eye(4), np.ones(6)),)))
    found = merged(maps, t_s, fixes)
    np.testing.assert_allclose(found.scene.poses[1], found.scene.poses[0])


@pytest.mark.slow
def test_drift_that_fixes_contradict_is_corrected():
    maps, true, t_s, fixes = two_maps()
    for made in maps:
        made.apply(MapUpdate(similarity=Similarity(1.1, np.eye(3), np.zeros(3))))
    found = merged(maps, t_s, fixes)
    assert away(found.scene.poses, true) < 0.4
    judged = replace(fixes, used=np.ones(len(fixes), dtype=bool))
    assert not found.assessment.rejected.any() and len(judged) == len(found.assessment.nominal)
