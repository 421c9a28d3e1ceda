from concurrent.futures import Future

import pytest

from vgps.online.fusion.fit_job import FitJob
from vgps.online.live_places import _Job


@pytest.mark.parametrize("made", [lambda future: FitJob(2.0, None, future), lambda future: _Job(2, future)])
def test_what_is_late_is_waited_for_only_where_poses_repeat(made):
    future = Future()
    job = made(future)
    assert [job.counts(now, True) for now in (1, 2, 3)] == [False, True, True]
    assert not any(job.counts(now, False) for now in (1, 2, 3))
    future.set_result(None)
    assert [job.counts(now, False) for now in (1, 2, 3)] == [False, True, True]
