"""A cluster that cannot be used is refused in one line."""

import sys

import pytest

from vgps.cluster import SmoothJob, scheduler, smooth_all
from vgps.config import Config
from vgps.errors import ClusterError

distributed = pytest.importorskip("distributed")


def jobs_of(folders, out):
    return [SmoothJob(recording=one, out=out / one.name, config=Config()) for one in folders]


def test_without_the_extra_the_message_names_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r"vgps\[cluster\]"):
        list(smooth_all(jobs_of([tmp_path], tmp_path), "local"))


@pytest.mark.slow
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense://here"])
def test_a_scheduler_that_is_not_there_is_named(monkeypatch, tmp_path, address):
    monkeypatch.setattr(scheduler, "_CONNECT_S", 0.2)
    with pytest.raises(ClusterError, match=f"{address} cannot be reached"):
        list(smooth_all(jobs_of([tmp_path], tmp_path), address))


@pytest.mark.slow
def test_a_scheduler_without_workers_says_how_to_start_one(monkeypatch, tmp_path):
    monkeypatch.setattr(scheduler, "_CONNECT_S", 1.0)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None) as cluster,
        pytest.raises(ClusterError, match=f"start one with: dask worker {cluster.scheduler_address}"),
    ):
        list(smooth_all(jobs_of([tmp_path], tmp_path), cluster.scheduler_address))


def test_a_worker_of_another_version_is_refused():
    here = {"vgps": "1.0", "gtsam": "4.3"}
    scheduler.check_versions({"tcp://a": here, "tcp://b": {**here, "dask": "1"}}, here)
    with pytest.raises(ClusterError, match=r"tcp://b has gtsam 4\.2; expected 4\.3, as here"):
        scheduler.check_versions({"tcp://a": here, "tcp://b": {**here, "gtsam": "4.2"}}, here)
