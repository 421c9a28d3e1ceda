"""Many recordings: smoothed one after the other, or on the machines of a dask.distributed scheduler."""

from vgps.cluster.job import JobReport, SmoothJob, smooth_job, summary_line
from vgps.cluster.join_job import JoinJob, join_job
from vgps.cluster.many import smooth_all, smooth_list
from vgps.cluster.recording_list import is_list, read_list

__all__ = [
    "JobReport",
    "JoinJob",
    "SmoothJob",
    "is_list",
    "join_job",
    "read_list",
    "smooth_all",
    "smooth_job",
    "smooth_list",
    "summary_line",
]
