"""When the frame pipeline runs stage C, and what it does with the outcome."""

import numpy as np
import pytest
from room_pipeline import COUNT, another_room, errors_m, exact_fixes, fed, pipeline, room
from textured_room import (
    CONFIG,
    FPS,
    images,
)

from vgps.errors import GeometryError
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import Frame
from vgps.pipeline.reconciliation import Reconciliation
from vgps.pipeline.window_worker import WindowOutcome

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def aligned():
    return fed(room(), exact_fixes())


def test_stage_c_and_alignment_wait_for_moving_frames(monkeypatch):
    made, windows, alignments = pipeline(), [], []
    optimise = made._worker.optimise
    monkeypatch.setattr(made._worker, "optimise", lambda m: windows.append(len(made.t_s)) or optimise(m))
    monkeypatch.setattr(made, "_align", lambda builder: alignments.append(len(made.t_s)))
    order = [*range(12), *[12] * 8, *range(13, 20)]
    for i, k in enumerate(order):
        made.add_frame(Frame(i, i / FPS, images(COUNT)[k]))
        made.refine()
    start = windows[0]
    moving = [n for n in range(start + 1, len(order) + 1) if not 13 < n <= 20]
    assert windows == [start, *moving[4::5]]  # every five moving frames
    assert alignments == moving


def test_a_failure_of_stage_c_leaves_the_map_and_three_in_a_row_end_it(monkeypatch):
    made, kept = pipeline(), []

    def fail(local_map):
        kept.append((local_map, local_map.poses.copy()))
        raise GeometryError("no minimum")

    monkeypatch.setattr(made._worker, "optimise", fail)
    for frame in room():
        made.add_frame(frame)
        if len(kept) == 3:
            break
    assert made.current is None and len({id(local_map) for local_map, _ in kept}) == 1
    np.testing.assert_array_equal(made.maps[0].poses[: len(kept[0][1])], kept[0][1])
    assert sum("stage C failed at" in w and "no minimum" in w for w in made.warnings) == 3
    assert "a new map begins" in made.warnings[-1]
    monkeypatch.undo()
    for later in another_room(frame.index + 1):
        made.add_frame(later)
    assert len(made.maps) == 2 and made.current is made.maps[1]


def test_a_failure_is_forgotten_after_a_success(monkeypatch):
    made, calls = pipeline(), []
    optimise = made._worker.optimise

    def fail_twice_of_three(local_map):
        calls.append(local_map)
        if len(calls) % 3:
            raise RuntimeError("not now")
        return optimise(local_map)

    monkeypatch.setattr(made._worker, "optimise", fail_twice_of_three)
    for frame in room():
        made.add_frame(frame)
    assert len(calls) >= 6 and len(made.maps) == 1 and made.current is made.maps[0]


def test_stage_c_beside_the_frames_ends_where_stage_c_at_once_does(aligned):
    window = CONFIG.window.model_copy(update={"delay_frames": 3})
    beside = fed(room(), exact_fixes(), config=CONFIG.model_copy(update={"window": window}))
    assert any(stage.endswith("beside") for stage in beside.timer.by_stage)
    assert errors_m(beside.maps[0]).max() < 0.05
    again = fed(room(), exact_fixes(), config=CONFIG.model_copy(update={"window": window}))
    np.testing.assert_array_equal(again.maps[0].poses, beside.maps[0].poses)


def test_the_result_of_stage_c_is_taken_a_fixed_number_of_frames_later(monkeypatch):
    window = CONFIG.window.model_copy(update={"delay_frames": 3})
    made, begun, taken = (
        pipeline(exact_fixes(), config=CONFIG.model_copy(update={"window": window})),
        [],
        [],
    )
    start, finish = made._worker.start, made._worker.finish
    monkeypatch.setattr(made._worker, "start", lambda m: begun.append(len(made.t_s)) or start(m))
    monkeypatch.setattr(made._worker, "finish", lambda: taken.append(len(made.t_s)) or finish())
    for frame in room():
        made.add_frame(frame)
    assert len(taken) > 1 and taken == [at + 3 for at in begun[: len(taken)]]
    # five moving frames after it began, stage C begins again
    assert begun == list(range(begun[0], COUNT + 1, 5))


def test_positions_that_stage_c_did_not_refine_are_triangulated_anew(aligned):
    local_map = aligned.maps[0].snapshot()
    ids = local_map.ids[local_map.positioned & (np.isfinite(local_map.views[..., 0]).sum(axis=1) > 10)][:6]
    wrong = Positions(ids, local_map.points[ids] + 1.0, np.full(6, 0.3))
    before = local_map.points[ids].copy()
    reconciliation = Reconciliation(MapUpdate(positions=wrong), unrefined=ids[:4])
    made = pipeline()
    made._apply(WindowOutcome(local_map, reconciliation, ("a warning",)))
    np.testing.assert_allclose(local_map.points[ids[:4]], before[:4], atol=0.3)
    np.testing.assert_allclose(local_map.points[ids[4:]], before[4:] + 1.0)
    assert made.warnings == ["a warning"]
