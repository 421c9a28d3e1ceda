import threading
from types import SimpleNamespace

from threadpoolctl import threadpool_info, threadpool_limits

from vgps.online.run import SourceNote, run_online


def test_blas_has_one_thread_from_the_first_item_to_the_last():
    seen = []

    def feed():
        for _ in range(2):
            seen.extend(one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas")
            yield SourceNote("")

    with threadpool_limits(limits=2, user_api="blas"):
        run_online(feed(), SimpleNamespace(add_note=str), print, threading.Event())
    assert set(seen) == {1}
