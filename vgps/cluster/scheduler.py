"""Jobs on the workers of a dask.distributed scheduler (the extra ``cluster``)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from vgps.cluster.job import JobReport, SmoothJob, reported
from vgps.errors import ClusterError
from vgps.runtime.threads import process_cores
from vgps.runtime.versions import versions

if TYPE_CHECKING:
    from distributed import Client

Job = TypeVar("Job")
Report = TypeVar("Report")

LOCAL = "local"
_CONNECT_S = 30.0  # to reach the scheduler, and until it has a worker
_INSTALL = "install the same versions on every worker"


def run_on_cluster(
    jobs: Sequence[SmoothJob], scheduler: str, announce: Callable[[str], None]
) -> Iterator[JobReport]:
    """Run jobs on the workers of a scheduler and yield reports as they end.

    The recordings and run folders have the same paths on every worker. The job of a worker that is lost goes
    to another one, and on from its last checkpoint.

    Args:
        jobs: The jobs.
        scheduler: Address, as ``tcp://HOST:8786``, or ``local`` for a worker per core of this machine.
        announce: Called with lines about the cluster.

    Raises:
        ClusterError: The extra is not installed, the scheduler cannot be reached, or a worker has other
            versions.
    """
    with _connected(scheduler, len(jobs), announce) as client:
        from distributed import as_completed  # noqa: PLC0415  (an extra)

        job_of = {client.submit(reported, job, pure=False): job for job in jobs}
        for future in as_completed(job_of):  # type: ignore[no-untyped-call]
            job, error = job_of[future], future.exception()
            if error is None:
                yield future.result()
            else:
                yield JobReport(recording=job.recording, out=job.out, error=_lost(error))


def run_one(
    work: Callable[[Job], Report], job: Job, scheduler: str, announce: Callable[[str], None]
) -> Report:
    """Do one job on a worker and return its report.

    Args:
        work: What to do, a function of a module.
        job: What it takes.
        scheduler, announce: As in :func:`run_on_cluster`.

    Raises:
        ClusterError: As in :func:`run_on_cluster`, or its workers were lost.
    """
    with _connected(scheduler, 1, announce) as client:
        future = client.submit(work, job, pure=False)
        error = future.exception()  # type: ignore[no-untyped-call]
        if error is not None:
            raise ClusterError(_lost(error), place="--scheduler")
        report: Report = future.result()
        return report


def _lost(error: BaseException) -> str:
    """Return why a job has no report."""
    from distributed import KilledWorker  # noqa: PLC0415  (an extra)

    if isinstance(error, KilledWorker):
        return "its workers were lost, one after the other: look at their memory, and run again with --resume"
    return f"the cluster could not run it ({type(error).__name__}: {error})"


@contextmanager
def _connected(scheduler: str, jobs: int, announce: Callable[[str], None]) -> "Iterator[Client]":
    """Yield a client of a scheduler, or of one that is started and ended here, and announce its workers."""
    try:
        from distributed import Client  # noqa: PLC0415  (an extra)
    except ImportError:
        raise ClusterError(
            "dask.distributed is not installed", place="--scheduler", remedy='pip install "vgps[cluster]"'
        ) from None
    options: dict[str, Any] = {"address": scheduler, "timeout": _CONNECT_S}
    if scheduler == LOCAL:
        options = {"n_workers": min(process_cores(), jobs), "threads_per_worker": 1, "memory_limit": None}
    try:
        client = Client(**options)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"{scheduler} cannot be reached ({error})",
            place="--scheduler",
            expected="tcp://HOST:PORT of a running dask scheduler, or local",
            remedy="start one with: dask scheduler",
        ) from error
    with client:
        announce(f"workers: {_checked_workers(client)}, dashboard: {client.dashboard_link}")
        yield client


def _checked_workers(client: "Client") -> int:
    """Return the number of workers, all of which have the versions of this process.

    Raises:
        ClusterError: There is none, or one has other versions.
    """
    address = client.scheduler.address if client.scheduler is not None else LOCAL
    try:
        client.wait_for_workers(1, timeout=_CONNECT_S)
    except TimeoutError:
        raise ClusterError(
            f"{address} has no worker", place="--scheduler", remedy=f"start one with: dask worker {address}"
        ) from None
    try:
        found: dict[str, dict[str, str]] = client.run(versions)
    except Exception as error:
        raise ClusterError(
            f"a worker cannot run vgps ({error})", place="--scheduler", remedy=_INSTALL
        ) from error
    check_versions(found, versions())
    return len(found)


def check_versions(found: Mapping[str, Mapping[str, str]], expected: Mapping[str, str]) -> None:
    """Check the versions of workers, by their addresses.

    Raises:
        ClusterError: One has another version, with which the result would not be the same.
    """
    for worker, there in found.items():
        for name, version in expected.items():
            if there.get(name) != version:
                raise ClusterError(
                    f"{worker} has {name} {there.get(name)}",
                    place="--scheduler",
                    expected=f"{version}, as here",
                    remedy=_INSTALL,
                )
