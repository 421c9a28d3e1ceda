"""Where the world of a recording begins."""

from dataclasses import replace

import numpy as np
import pytest
from textured_room import CONFIG, ROOM_ORIGIN, path, room_control_points, room_gps_log, room_recording

from vgps.errors import GpsLogError, RecordingError
from vgps.gps.world_frame import world_fixes
from vgps.model import GeodeticPoint, Rig

POSES = path(24)
LOG = room_gps_log(POSES)


def recorded(rig=Rig(), **parts):  # noqa: B008
    return replace(room_recording(POSES, **parts), rig=rig)


def first_of(points):
    return GeodeticPoint(*points.world_p_point[0])


@pytest.mark.parametrize("geodetic", [True, False])
def test_without_fixes_only_geodetic_control_points_have_an_origin(geodetic):
    points = room_control_points(POSES, geodetic)
    origin, fixes = world_fixes(recorded(control_points=points), CONFIG)
    assert origin == (first_of(points) if geodetic else None) and len(fixes.t_s) == 0


def test_a_video_alone_has_no_origin():
    assert world_fixes(recorded(), CONFIG)[0] is None


def test_the_rig_s_origin_counts_first_then_a_control_point_then_a_fix():
    points = room_control_points(POSES, geodetic=True)
    given = world_fixes(recorded(Rig(world_origin=ROOM_ORIGIN), gps=LOG, control_points=points), CONFIG)
    assert given[0] == ROOM_ORIGIN
    by_points, fixes = world_fixes(recorded(gps=LOG, control_points=points), CONFIG)
    assert by_points == first_of(points) and np.linalg.norm(fixes.world_p_fix[0]) > 0.1
    by_fixes, fixes = world_fixes(recorded(gps=LOG), CONFIG)
    assert by_fixes == GeodeticPoint(LOG.latitude_deg[0], LOG.longitude_deg[0], LOG.height_m[0])
    np.testing.assert_allclose(fixes.world_p_fix[0], 0.0, atol=1e-6)


def test_control_points_in_enu_beside_fixes_need_an_origin():
    points = room_control_points(POSES, geodetic=False)
    with pytest.raises(RecordingError, match="control points in ENU without an origin"):
        world_fixes(recorded(gps=LOG, control_points=points), CONFIG)


def test_a_log_that_misses_the_video_is_refused():
    with pytest.raises(GpsLogError, match="usable fixes during the video: 0"):
        world_fixes(recorded(gps=replace(LOG, t_s=LOG.t_s + 3600.0)), CONFIG)
