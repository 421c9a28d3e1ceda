"""Events of a live session and the warnings of its result."""

from vgps.online import event_queue
from vgps.online.estimate import OnlineEvent
from vgps.online.event_queue import EventQueue

PLACE = OnlineEvent(1.0, "place", "seen again")


def test_events_are_given_once_and_in_order():
    queue, notes = EventQueue(), ["stage C failed"]
    queue.add([PLACE])
    queue.add_notes(2.0, notes)
    assert queue.take() == (PLACE, OnlineEvent(2.0, "note", "stage C failed"))
    assert queue.take() == () and notes == [] and queue.warnings == ["stage C failed"]


def test_a_result_keeps_the_first_notes_only(monkeypatch):
    monkeypatch.setattr(event_queue, "_MAX_WARNINGS", 3)
    queue = EventQueue()
    for text in ("a", "b"):
        queue.add_notes(0.0, [text])
    queue.add_notes(0.0, ["c", "d"])
    queue.add_notes(0.0, ["e"])
    assert queue.warnings == ["a", "b", "c"]
    assert [event.text for event in queue.take()] == ["a", "b", "c", "d", "e"]
