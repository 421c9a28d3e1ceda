"""Landmarks as LAS or LAZ 1.4 points in a coordinate system, with laspy (the extra ``las``)."""

from pathlib import Path

import numpy as np

from vgps.errors import RunFolderError
from vgps.writers.export_job import ExportJob

_SCALE_M, _SCALE_DEG = 1e-4, 1e-9
_GREY16 = 257  # LAS has 16 bits a colour


def write_las(job: ExportJob, out: Path) -> None:
    """Write the landmarks with grey, reliability and number of observations; ``.laz`` is compressed.

    Raises:
        RunFolderError: laspy is not installed, or the run is not georeferenced.
    """
    try:
        import laspy  # noqa: PLC0415  (an extra)
    except ImportError as error:
        raise RunFolderError("LAS needs laspy", remedy="pip install 'vgps[las]'") from error
    system, (marks, observations) = job.georeferenced, job.solution.all_landmarks
    points = system.from_geodetic(job.geodetic_of(marks.world_p_landmark))
    header = laspy.LasHeader(point_format=7, version="1.4")
    flat = _SCALE_DEG if system.is_geographic else _SCALE_M
    header.scales = np.array([flat, flat, _SCALE_M])
    header.offsets = np.floor(points.min(axis=0, initial=np.inf)) if len(points) else np.zeros(3)
    header.add_crs(system.definition)
    header.system_identifier, header.generating_software = "vgps landmarks", "vgps"
    for name, kind in (("sigma_px", np.float32), ("observations", np.uint32)):
        header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=kind))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    for colour in ("red", "green", "blue", "intensity"):
        cloud[colour] = marks.gray.astype(np.uint16) * _GREY16
    cloud["sigma_px"] = marks.sigma_px
    cloud["observations"] = np.bincount(observations.landmark, minlength=len(points))
    with out.open("wb") as stream:
        cloud.write(stream, do_compress=out.suffix.lower() == ".laz")
