"""Features, read back from a saved recording."""

import numpy as np
import pytest
from reading_back import Logged

from vgps.camera import distort
from vgps.solution import Solution


@pytest.mark.slow
def test_features_are_where_the_video_shows_them_and_coloured_by_their_error(
    logged: Logged, solution: Solution
) -> None:
    frames = logged.rows("/world/camera/image/features", "Points2D:positions")
    assert [len(points) for points in frames] == [3] * 6
    observations = solution.observations
    shown = distort(solution.camera, observations.uv_px[observations.frame == 0])
    np.testing.assert_allclose(sorted(frames[0]), sorted(shown.tolist()), rtol=1e-5)
    tints = [row for row in logged.rows("/world/camera/image/features", "Points2D:colors") if len(row) == 3]
    assert sum(tint >> 8 == 0xFADC28 for tint in tints[0]) == 1  # one pixel of error: yellow
    assert all(tint >> 8 == 0x3CDC5A for tint in tints[1])


@pytest.mark.slow
def test_residual_lines_are_ten_times_as_long(logged: Logged) -> None:
    lines = logged.rows("/world/camera/image/residuals_x10", "LineStrips2D:strips")
    lengths = [np.linalg.norm(np.subtract(end, begin)) for begin, end in lines[0]]
    # one error of a pixel, in the distorted image
    assert sorted(np.round(lengths, 1))[:2] == [0.0, 0.0] and 9.0 < max(lengths) < 11.0


@pytest.mark.slow
def test_what_never_moves_is_framed_while_it_is_left_out(logged: Logged) -> None:
    entity = "/world/camera/image/static_regions"
    assert [len(boxes) for boxes in logged.rows(entity, "Boxes2D:centers")] == [1, 2, 1]  # frames 1, 2, 4
    assert logged.rows(entity, "Boxes2D:centers")[0] == [[100.0, 460.0]]
    assert logged.rows(entity, "Boxes2D:half_sizes")[2] == [[100.0, 20.0]]


def test_what_moves_on_its_own_is_framed_in_its_frame(logged: Logged) -> None:
    entity = "/world/camera/image/moving_regions"
    assert [len(boxes) for boxes in logged.rows(entity, "Boxes2D:centers")] == [1, 0]
    assert logged.rows(entity, "Boxes2D:centers")[0] == [[150.0, 170.0]]
