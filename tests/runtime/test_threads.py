import contextlib
import os
import sys
import threading
import time
from collections.abc import Generator

import numpy  # noqa: F401  # brings a BLAS
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from vgps.runtime.threads import (
    begin,
    map_in_order,
    one_blas_thread,
    prompt_threads,
    run_ahead,
    usable_cores,
)


def blas_threads() -> list[int]:
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


def test_blas_has_one_thread_inside_and_as_many_as_before_after_it() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        with one_blas_thread():
            assert set(blas_threads()) == {1}
        assert set(blas_threads()) == {2}


def test_blas_keeps_one_thread_to_the_end_of_the_outermost_context() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        for _ in range(2):
            with one_blas_thread():
                with one_blas_thread():
                    pass
                assert set(blas_threads()) == {1}
            assert set(blas_threads()) == {2}


def test_what_is_begun_runs_while_the_caller_goes_on() -> None:
    signal = threading.Event()
    seen = begin(signal.wait, timeout=10.0)
    assert not seen.done()
    signal.set()
    assert seen.result()


def test_a_thread_that_is_done_is_used_again():
    assert len({begin(threading.get_ident).result() for _ in range(20)}) < 10


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of Python 3.12, of forks beside threads
def test_a_forked_process_has_threads_of_its_own():
    assert begin(int).result() == 0
    child = os.fork()
    if child == 0:
        with contextlib.suppress(TimeoutError):
            os._exit(begin(lambda: 7).result(timeout=20.0))
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


def test_threads_are_prompt_inside_and_as_before_after_it():
    before = sys.getswitchinterval()
    with pytest.raises(ZeroDivisionError), prompt_threads():
        inside_s = sys.getswitchinterval()
        raise ZeroDivisionError
    assert inside_s < before
    assert sys.getswitchinterval() == before


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vgps.runtime.threads.usable_cores", lambda: 2)


@pytest.mark.usefixtures("two_cores")
def test_results_come_in_order_from_two_threads_that_do_not_run_ahead():
    both, begun = threading.Barrier(2, timeout=10.0), []

    def work(number: int) -> int:
        begun.append(number)
        if number < 2:
            both.wait()  # passed only if two of them run at the same time
        time.sleep(0.005 * (number % 2))
        return number * number

    for count, result in enumerate(map_in_order(work, range(12))):
        assert result == count * count
        assert len(begun) <= count + 5  # four under way, and the next one


@pytest.mark.usefixtures("two_cores")
def test_an_error_in_a_thread_arrives():
    with pytest.raises(ZeroDivisionError):
        list(map_in_order(lambda number: 1 // (number - 5), range(8)))


@pytest.mark.usefixtures("two_cores")
def test_few_items_stay_in_the_thread_of_the_caller():
    assert set(map_in_order(lambda _: threading.get_ident(), range(3))) == {threading.get_ident()}


def test_what_runs_ahead_goes_on_without_its_reader_but_only_by_so_many_items():
    made: list[int] = []

    def numbers() -> Generator[int]:
        for number in range(100):
            made.append(number)
            yield number

    items = run_ahead(numbers)
    assert next(items) == 0
    deadline = time.monotonic() + 10.0
    while len(made) < 10:  # the first, eight that wait, and one for which there is no room
        assert time.monotonic() < deadline
        time.sleep(0.001)
    time.sleep(0.15)  # longer than one try to put
    assert len(made) == 10
    assert list(items) == list(range(1, 100))


def test_what_runs_ahead_passes_its_error_on_after_its_items():
    def failing() -> Generator[int]:
        yield 1
        raise ZeroDivisionError

    items = run_ahead(failing)
    assert next(items) == 1
    with pytest.raises(ZeroDivisionError):
        next(items)


def test_closing_what_runs_ahead_closes_the_generator():
    closed = threading.Event()

    def endless() -> Generator[int]:
        try:
            while True:
                yield 1
        finally:
            closed.set()

    items = run_ahead(endless)
    next(items)
    items.close()
    assert closed.is_set()


@pytest.mark.parametrize(("given", "expected"), [("1", 1), ("0", None), ("1,4", 1), ("1000000", None)])
def test_the_environment_lowers_the_number_of_threads(monkeypatch, given, expected):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    every = usable_cores()
    assert 1 <= every <= (os.cpu_count() or 1)
    monkeypatch.setenv("OMP_NUM_THREADS", given)
    assert usable_cores() == (expected or every)
