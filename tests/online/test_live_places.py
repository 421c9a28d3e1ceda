"""The textured room there and back; on the way back there are no fixes."""

from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np
import pytest
from textured_room import CAMERA, CONFIG, FPS, followed_map, path, room_gps_log, room_recording

from vgps.config import Config, LoopsConfig
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView
from vgps.online import OnlineSmoother
from vgps.online.live_places import LivePlaces, _Job
from vgps.online.replay import fixes_of
from vgps.places.recognition import Answer, Recognised

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


class Recognising:
    """Live places that are told, without images, what was recognised; one frame a second."""

    def __init__(self):
        self.ties = None
        self.pipeline = SimpleNamespace(t_s=np.arange(1))
        self.places = LivePlaces(self.pipeline, SimpleNamespace(tie=self.tie), CAMERA, Config())

    def tie(self, ties):
        self.ties = ties

    def recognise(self, now_s, earlier_s, sigma_m, before_m):
        """Return the events of a frame that shows the place of an earlier time, and the times that count."""
        self.pipeline.t_s = np.arange(now_s + 1)
        found = Recognised(
            frame=now_s,
            earlier=earlier_s,
            world_T_camera=np.eye(4),
            sigma=np.full(6, sigma_m),
            before_m=before_m,
            travelled_m=0.0,
        )
        answer = Future()
        answer.set_result(Answer(0.0, found))
        events = self.places._use(_Job(now_s, answer))
        return len(events), None if self.ties is None else self.ties.t_s.tolist()


def test_a_place_that_was_not_known_much_better_does_not_count():
    live_places = Recognising()
    assert live_places.recognise(300, 10, sigma_m=0.6, before_m=1.0) == (0, None)
    assert live_places.recognise(301, 11, sigma_m=0.4, before_m=1.0) == (1, [301.0])


def test_only_the_newest_place_of_a_visit_counts():
    live_places = Recognising()
    assert live_places.recognise(300, 10, sigma_m=0.1, before_m=1.0) == (1, [300.0])
    # now the path is as well known as the place, which has the same errors still
    assert live_places.recognise(310, 20, sigma_m=0.1, before_m=0.1) == (0, [310.0])
    # a place of another time has errors of its own
    assert live_places.recognise(320, 200, sigma_m=0.1, before_m=1.0) == (1, [310.0, 320.0])
    # what was known before a visit is forgotten after two minutes
    assert live_places.recognise(500, 30, sigma_m=0.1, before_m=0.1) == (0, [310.0, 320.0])
    assert live_places.recognise(501, 30, sigma_m=0.1, before_m=0.3) == (1, [501.0])


def test_a_look_that_fails_leaves_all_as_it_was():
    live_places, answer = Recognising(), Future()
    answer.set_exception(np.linalg.LinAlgError())
    assert live_places.places._use(_Job(1, answer)) == [] and live_places.ties is None


class Looking:
    """Live places whose looks are noted instead of answered, along a map that forgets."""

    def __init__(self):
        self.map, _ = followed_map(np.repeat(path(1), 2, axis=0))
        self.looks = []
        static = SimpleNamespace(masked=lambda frame: frame)
        self.pipeline = SimpleNamespace(
            current=self.map, camera=CAMERA, tracker=SimpleNamespace(static=static)
        )
        self.fusion = SimpleNamespace(placed=lambda: (None, SimpleNamespace(t_s=self.map.t_s)))
        self.places = LivePlaces(self.pipeline, self.fusion, CAMERA, Config())
        self.places._recogniser = SimpleNamespace(look=self.look)
        self.see()

    def look(self, given, along):
        self.looks.append(given)
        return Answer(given.travelled_m + 1.0)

    def see(self):
        self.pipeline.t_s = np.arange(self.map.next_frame) / FPS
        self.places.see(np.zeros((CAMERA.height, CAMERA.width), np.uint8))
        if self.places._job is not None:
            self.places._job.answer.result()

    def add(self, north_m=0.0):
        """A frame so far north of the last one; the map keeps 60 frames, and what 40 of them observe."""
        frame, pose = self.map.next_frame, self.map.poses[-1].copy()
        pose[1, 3] += north_m
        view = NewView(frame, self.map.raw_uv_px, self.map.last_uv_px, np.ones(len(self.map.ids), dtype=bool))
        self.map.apply(MapUpdate(frames=(NewFrame(frame / FPS, pose),), view=view))
        self.map.discard_before(frame - 60, frame - 40)


@pytest.mark.slow
def test_a_place_is_remembered_however_slowly_the_camera_leaves_it():
    looking = Looking()
    for _ in range(200):
        looking.add()
        looking.see()
    looking.add(2.0)
    looking.pipeline.camera = "refined"
    looking.see()
    assert looking.places._recogniser.camera == "refined"
    first, second = looking.looks
    assert first.settled == () and [one.frame for one in second.settled] == [1]
    assert len(second.settled[0].depth) > 50 and np.all(second.settled[0].depth > 0.0)


@pytest.mark.slow
def test_a_frame_that_left_the_map_while_the_camera_was_lost_is_no_place():
    looking = Looking()
    for _ in range(200):
        looking.add()
    looking.add(2.0)
    looking.see()
    assert [one.settled for one in looking.looks] == [(), ()]
