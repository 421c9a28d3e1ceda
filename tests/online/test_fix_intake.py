from pathlib import Path

import numpy as np
import pytest
from textured_room import CAMERA

from vgps.config import Config
from vgps.gps.fixes import Fixes
from vgps.model import FixClass, Frame, GeodeticPoint
from vgps.online.fix_intake import FixIntake
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.readers.gps_formats.fixes import Fix
from vgps.smoothing.context import SmoothingContext

ORIGIN = GeodeticPoint(49.0, 8.4, 120.0)


def make_intake(origin: GeodeticPoint | None) -> tuple[FixIntake, FramePipeline]:
    """An intake before the first frame."""
    pipeline = FramePipeline(SmoothingContext(CAMERA, Config()), np.zeros(3), Fixes.empty())
    return FixIntake(pipeline, Config().gps, Path("live"), origin), pipeline


def fix(t_s: float, kind: FixClass = FixClass.RTK_FIX) -> Fix:
    return Fix(t_s, 49.0, 8.4 + 1e-13 * t_s, 121.0, kind, line=1)


def test_fixes_are_placed_about_a_given_origin() -> None:
    intake, pipeline = make_intake(ORIGIN)
    assert intake.add(fix(0.5)) and intake.add(fix(0.2))
    placed = pipeline.fix_buffer.fixes
    assert placed.t_s.tolist() == [0.2, 0.5]
    np.testing.assert_allclose(placed.world_p_fix, [[0.0, 0.0, 1.0]] * 2, atol=1e-6)


def test_fixes_wait_for_a_usable_one_within_the_video() -> None:
    intake, pipeline = make_intake(None)
    assert intake.add(fix(-3.0)) and intake.origin is None
    pipeline.track_frame(Frame(0, 0.0, np.zeros((CAMERA.height, CAMERA.width), np.uint8)))
    assert intake.add(fix(0.1, FixClass.UNKNOWN)) and intake.origin is None
    assert len(pipeline.fix_buffer.fixes) == 0
    assert intake.add(fix(0.2)) and intake.origin is not None
    assert len(pipeline.fix_buffer.fixes) == len(intake.archive) == 3


@pytest.mark.parametrize("origin", [ORIGIN, None])  # placed already, and still waiting
def test_a_fix_at_the_time_of_another_is_refused(origin: GeodeticPoint | None) -> None:
    intake, _ = make_intake(origin)
    assert intake.add(fix(0.5)) and not intake.add(fix(0.5 + 1e-9)) and intake.add(fix(0.6))


def test_a_position_that_the_receiver_repeats_is_one_fix_a_second() -> None:
    """A receiver of 1 Hz that is asked ten times a second, which then stands."""
    intake, _ = make_intake(ORIGIN)
    positions = [0.0] * 10 + [1e-5] * 25
    taken = [
        intake.add(Fix(0.1 * k, 49.0 + at, 8.4, 121.0, FixClass.SINGLE, line=1))
        for k, at in enumerate(positions)
    ]
    assert np.flatnonzero(taken).tolist() == [0, 10, 20, 30]
    assert intake.add(Fix(3.5, 49.0 + 1e-5, 8.4, 121.0, FixClass.DGPS, line=1))


def test_a_clock_that_jumped_is_noted() -> None:
    intake, pipeline = make_intake(ORIGIN)
    pipeline.track_frame(Frame(0, 0.0, np.zeros((CAMERA.height, CAMERA.width), np.uint8)))
    assert not intake.add(fix(3601.0))
    assert pipeline.warnings == ["the receiver's clock jumped: 1 fix from the future left out so far"]
    assert intake.add(fix(3599.0))


def test_the_last_digits_are_those_of_all_fixes_so_far() -> None:
    intake, pipeline = make_intake(ORIGIN)
    intake.add(Fix(0.0, 49.00001, 8.4, 121.5, FixClass.RTK_FIX, line=1))
    intake.add(Fix(1.0, 49.0000123, 8.4, 168.91, FixClass.RTK_FIX, line=1, geoid_m=47.31))
    placed = pipeline.fix_buffer.fixes
    steps_m = placed.logging_sigma_m * np.sqrt(12.0)
    np.testing.assert_allclose(steps_m[:, 1], [1.11, 0.0111], rtol=3e-3)
    np.testing.assert_allclose(steps_m[:, 2], 0.1)
