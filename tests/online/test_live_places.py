"""The textured room there and back; on the way back there are no fixes."""

import numpy as np
import pytest
from textured_room import CONFIG, path, room_gps_log, room_recording

from vgps.config import LoopsConfig
from vgps.online import OnlineSmoother
from vgps.online.replay import fixes_of

THERE = 45
POSES = np.concatenate([path(THERE), path(THERE)[::-1]])


def live(**settings):
    """Estimates of all frames, with the looks for places close to each other."""
    loops = LoopsConfig(apart=0.3, reach=0.05, spacing=0.02, **settings)
    recording = room_recording(POSES)
    smoother = OnlineSmoother(
        recording.camera, recording.rig, CONFIG.model_copy(update={"loops": loops, "seed": 1})
    )
    for fix in fixes_of(room_gps_log(POSES[:THERE])):
        smoother.add_fix(fix)
    return [smoother.add_frame(frame.t_s, frame.gray) for frame in recording.video.frames()]


@pytest.mark.slow
def test_a_place_seen_again_corrects_global_during_an_outage_and_local_goes_on():
    with_places, without = live(), live(close="no")
    seen = [event for one in with_places for event in one.events if event.kind == "place"]
    assert len(seen) == 1 and not any(event.kind == "place" for one in without for event in one.events)
    assert 0.0 <= seen[0].details["earlier_s"] < THERE / 10.0 < seen[0].t_s
    after = slice(int(10 * seen[0].t_s) + 6, None)
    runs = with_places[after], without[after]
    sigma_m, before_m = (np.array([np.linalg.norm(one.sigma_position_m) for one in run]) for run in runs)
    assert np.all(sigma_m < before_m) and np.median(sigma_m / before_m) < 0.6
    error_m, error_before_m = (
        np.linalg.norm([one.global_T_camera[:3, 3] for one in run] - POSES[after, :3, 3], axis=1)
        for run in runs
    )
    assert error_m.mean() < error_before_m.mean() and np.all(error_m < 3.0 * sigma_m)
    local = np.array([one.local_T_camera[:3, 3] for one in with_places])[THERE:]
    assert np.linalg.norm(np.diff(local, axis=0), axis=1).max() < 0.3
