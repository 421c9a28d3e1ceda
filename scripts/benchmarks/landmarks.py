"""How long a landmark database takes to open and to say what a camera sees; 200,000 landmarks, 8 views each.

The landmarks line a street of 10 km, 20 to the metre, each seen from eight places up to some tens of metres
away, a few of them from some hundreds; a camera then looks along it. ``first`` are queries at places whose
landmarks have not been read yet since the database was opened; ``moving`` a camera that drives on by 0.5 m
from one to the next, as a video's does; ``turning`` one that stands and turns. Wall time and, as other
programs may be at work, time on the processor.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.model import DatabaseContents, LandmarkViews
from vgps.model import Camera, FloatArray, GeodeticPoint

CAMERA = Camera(model="pinhole", width=1242, height=374, fx=721.5, fy=721.5, cx=609.6, cy=172.9)
VIEWS, LEVELS, PATCH_PX = 8, 3, 15
STREET_M = 10_000.0
EAST_R_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # looks east along the street


def street(landmarks: int, rng: np.random.Generator) -> DatabaseContents:
    """Landmarks along a street to the east, most of them seen from 5 to 60 m, some from 300 m."""
    point = np.column_stack(
        [
            rng.uniform(0, STREET_M, landmarks),
            rng.choice([-1.0, 1.0], landmarks) * rng.uniform(4, 15, landmarks),
            rng.uniform(0, 8, landmarks),
        ]
    )
    middle_m = 2 ** rng.uniform(np.log2(8), np.log2(60), landmarks)
    middle_m[rng.uniform(size=landmarks) < 0.05] *= 5
    depth = (middle_m[:, None] * np.linspace(0.7, 1.4, VIEWS)).ravel()
    owner = np.repeat(np.arange(landmarks), VIEWS)
    camera = point[owner]
    camera[:, 0] -= depth
    camera[:, 1:] = (0.0, 1.65)
    axes = depth[:, None, None] / CAMERA.fx * EAST_R_CAMERA[:, :2].T
    templates = rng.integers(0, 256, (len(owner), LEVELS, PATCH_PX, PATCH_PX), np.uint8)
    ones = np.ones(len(owner))
    views = LandmarkViews(
        owner, point[owner], camera, axes[:, 0], axes[:, 1], templates, 0.4 * ones, 0.1 * ones
    )
    return DatabaseContents(GeodeticPoint(49.0, 8.4, 160.0), views, (), ())


def pose_at(east_m: float) -> FloatArray:
    """A camera in the middle of the street that looks along it."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = EAST_R_CAMERA, (east_m, 0.0, 1.65)
    return pose


def turned(pose: FloatArray, angle_rad: float) -> FloatArray:
    """The camera turned about its vertical axis."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    out = pose.copy()
    out[:3, :3] = pose[:3, :3] @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return out


def time_queries(what: str, database: LandmarkDatabase, poses: list[FloatArray], most: int | None) -> None:
    """Print least, median and 99th percentile of a query at each place."""
    ms, found = [], []
    for pose in poses:
        begin = time.perf_counter(), time.thread_time()
        views = database.views(pose, CAMERA, max_landmarks=most)
        ms.append([1e3 * (time.perf_counter() - begin[0]), 1e3 * (time.thread_time() - begin[1])])
        found.append(len(views))
    wall, cpu = np.percentile(ms, [0, 50, 99], axis=0).T
    name = f"{what}, {'all' if most is None else f'at most {most}'}"
    print(
        f"{name:20} wall least {wall[0]:.2f} median {wall[1]:.2f} p99 {wall[2]:.2f} ms, "
        f"processor least {cpu[0]:.2f} median {cpu[1]:.2f} p99 {cpu[2]:.2f} ms, {np.mean(found):.0f} views"
    )


def report(path: Path) -> None:
    """Print how long opening and queries take."""
    opening = []
    for _ in range(50):
        begin = time.perf_counter(), time.thread_time()
        LandmarkDatabase.open(path).close()
        opening.append([1e3 * (time.perf_counter() - begin[0]), 1e3 * (time.thread_time() - begin[1])])
    wall, cpu = np.median(opening, axis=0)
    print(f"open: wall median {wall:.2f} ms, processor {cpu:.2f} ms; {path.stat().st_size / 2**20:.0f} MB")
    rng = np.random.default_rng(1)
    for most in (200, None):
        with LandmarkDatabase.open(path) as database:
            time_queries("first", database, [pose_at(m) for m in rng.uniform(0, STREET_M - 600, 50)], most)
        with LandmarkDatabase.open(path) as database:
            drive = [pose_at(m) for m in rng.uniform(0, STREET_M - 900) + 0.5 * np.arange(600)]
            database.views(drive[0], CAMERA, max_landmarks=most)
            time_queries("moving", database, drive[1:], most)
            turns = [turned(drive[-1], angle) for angle in 0.3 * np.sin(np.arange(300) / 10)]
            time_queries("turning", database, turns, most)


def main() -> None:
    """Make the database in a scratch folder, or use the one kept, and time it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--landmarks", type=int, default=200_000)
    parser.add_argument("--keep", type=Path, help="file that is made if it is absent, and left")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        path = arguments.keep or Path(scratch) / "street.vgps"
        if not path.exists():
            write_database(street(arguments.landmarks, np.random.default_rng(0)), path)
        report(path)


if __name__ == "__main__":
    main()
