"""How long does a landmark database take to open, and to say what a camera sees?

By default 200,000 landmarks with eight views each line a street of 10 km, 20 to the metre, each seen from up
to some tens of metres, a few from some hundreds; a camera looks along the street. ``first`` are queries at
places whose landmarks have not been read since the database was opened; ``moving`` a camera that drives on by
0.5 m from query to query, as a video's does; ``turning`` one that stands and turns. Wall time, and processor
time for when other programs are at work.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from scripts.common.command import ScriptParser
from scripts.common.markdown import table
from scripts.common.stopwatch import stopwatch
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.model import DatabaseContents, LandmarkViews
from vgps.model import Camera, FloatArray, GeodeticPoint

CAMERA = Camera(model="pinhole", width=1242, height=374, fx=721.5, fy=721.5, cx=609.6, cy=172.9)
VIEWS, LEVELS, PATCH_PX = 8, 3, 15
STREET_M = 10_000.0
EAST_R_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # looks east along the street


def street(landmarks: int, rng: np.random.Generator) -> DatabaseContents:
    """Return landmarks along a street to the east, most of them seen from 5 to 60 m, some from 300 m."""
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
        landmark=owner,
        world_p_landmark=point[owner],
        world_p_camera=camera,
        world_v_column=axes[:, 0],
        world_v_row=axes[:, 1],
        templates=templates,
        sigma_px=0.4 * ones,
        position_sigma_m=0.1 * ones,
    )
    return DatabaseContents(GeodeticPoint(49.0, 8.4, 160.0), views, (), ())


def pose_at(east_m: float) -> FloatArray:
    """Return the pose of a camera in the middle of the street that looks along it."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = EAST_R_CAMERA, (east_m, 0.0, 1.65)
    return pose


def rotated(pose: FloatArray, angle_rad: float) -> FloatArray:
    """Return the pose rotated about the camera's vertical axis."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    out = pose.copy()
    out[:3, :3] = pose[:3, :3] @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return out


def time_queries(database: LandmarkDatabase, poses: list[FloatArray], limit: int | None) -> dict[str, float]:
    """Return least, median and 99th percentile of a query over the places, ms, and the mean view count."""
    ms, found = [], []
    for pose in poses:
        with stopwatch() as elapsed:
            views = database.views(pose, CAMERA, max_landmarks=limit)
        ms.append([1e3 * elapsed.wall_s, 1e3 * elapsed.thread_s])
        found.append(len(views))
    percentiles = np.percentile(ms, [0, 50, 99], axis=0).T
    names = [f"{clock}_{which}_ms" for clock in ("wall", "cpu") for which in ("least", "median", "p99")]
    return dict(zip(names, percentiles.ravel().tolist(), strict=True)) | {"views": float(np.mean(found))}


def time_opening(path: Path) -> tuple[float, float]:
    """Return median wall and processor milliseconds of opening the database."""
    ms = []
    for _ in range(50):
        with stopwatch() as elapsed:
            LandmarkDatabase.open(path).close()
        ms.append([1e3 * elapsed.wall_s, 1e3 * elapsed.thread_s])
    wall_ms, cpu_ms = np.median(ms, axis=0)
    return float(wall_ms), float(cpu_ms)


def measure(path: Path) -> list[dict[str, Any]]:
    """Return a row per kind of query and limit of landmarks."""
    rng = np.random.default_rng(1)
    rows: list[dict[str, Any]] = []

    def row(query: str, limit: int | None, database: LandmarkDatabase, poses: list[FloatArray]) -> None:
        rows.append({"query": query, "limit": limit, **time_queries(database, poses, limit)})

    for limit in (200, None):
        with LandmarkDatabase.open(path) as database:
            row("first", limit, database, [pose_at(m) for m in rng.uniform(0, STREET_M - 600, 50)])
        with LandmarkDatabase.open(path) as database:
            drive = [pose_at(m) for m in rng.uniform(0, STREET_M - 900) + 0.5 * np.arange(600)]
            database.views(drive[0], CAMERA, max_landmarks=limit)
            row("moving", limit, database, drive[1:])
            turn = [rotated(drive[-1], angle) for angle in 0.3 * np.sin(np.arange(300) / 10)]
            row("turning", limit, database, turn)
    return rows


def main() -> None:
    """Make the database in a scratch folder, or use the one kept, and time it."""
    parser = ScriptParser("benchmarks.landmarks", __doc__)
    parser.add_argument("--landmarks", type=int, default=200_000, help="number of landmarks")
    parser.add_argument("--keep", type=Path, help="database file that is made if it is absent, and left")
    given = parser.parse_args()
    with parser.refusals(), tempfile.TemporaryDirectory() as scratch:
        results = parser.results(given)
        path = given.keep or Path(scratch) / "street.vgps"
        if not path.exists():
            write_database(street(given.landmarks, np.random.default_rng(0)), path)
        wall_ms, cpu_ms = time_opening(path)
        size_mb = path.stat().st_size / 2**20
        print(f"open: wall median {wall_ms:.2f} ms, processor {cpu_ms:.2f} ms; {size_mb:.0f} MB\n")
        results.summarise(
            landmarks=given.landmarks, open_wall_ms=wall_ms, open_cpu_ms=cpu_ms, size_mb=size_mb
        )
        rows = measure(path)
    for one in rows:
        results.add(**one)
    figures = [name for name in rows[0] if name not in ("query", "limit")]
    cells = [
        [f"{one['query']}, {one['limit'] or 'no limit'}", *(f"{one[name]:.2f}" for name in figures)]
        for one in rows
    ]
    print(table(["query", *(name.replace("_", " ") for name in figures)], cells))


if __name__ == "__main__":
    main()
