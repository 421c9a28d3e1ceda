from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from textured_room import CAMERA, path, room_recording

from vgps.pipeline.shown_frames import shown_frames

SIZE = (CAMERA.height, CAMERA.width)


def test_masks_and_what_never_moves_are_left_out_of_their_frames() -> None:
    given = np.ones(SIZE, bool)
    given[:, :50] = False
    recording = room_recording(path(4))
    masked = replace(recording, masks=SimpleNamespace(files=(), of_frame={1: given, 2: given}.get))
    regions = np.array([[0, 1, 10, 200, 300, 240], [1, 1, 0, 0, 20, 30]])
    first, second, third, last = (frame.mask for frame in shown_frames(masked, regions))
    assert first is not None and second is not None and last is None
    assert (~first).sum() == 290 * 40 and not first[200:240, 10:300].any()
    np.testing.assert_array_equal(third, given)
    expected = first & given
    expected[:30, :20] = False
    np.testing.assert_array_equal(second, expected)
    assert given[:, 50:].all()
    assert all(frame.mask is None for frame in shown_frames(recording))
