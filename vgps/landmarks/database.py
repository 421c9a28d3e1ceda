"""The landmark database, read: which landmarks a camera sees, and how they looked from near there."""

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vgps.config import SelectionConfig
from vgps.landmarks.candidate_region import CandidateRegion, find_candidates, optics
from vgps.landmarks.cells import concatenated_ranges
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.landmark_table import LandmarkTable, TemplateCache
from vgps.landmarks.model import DatabaseContents, Keyframe, LandmarkViews, Source
from vgps.landmarks.schema import KEYFRAME_COLUMNS, SOURCE_COLUMNS, decode_keyframe
from vgps.landmarks.view_selection import VisibleLandmarks, best_views, spread_over_image, visible_landmarks
from vgps.model import Camera, Float32Array, FloatArray, GeodeticPoint, IntArray

_MORE = 2  # candidates whose views are looked at, for each landmark that is wanted


class LandmarkDatabase:
    """A landmark database, opened for reading; a context manager, for one thread.

    Attributes:
        path: The file.
        world_origin: Where the ENU frame of all positions stands; absent where control points alone gave it.
        patch_px, levels: Side of the templates, and at how many scales they are kept.
        landmark_count, view_count: How many landmarks, and views of them.
    """

    def __init__(self, file: DatabaseFile, selection: SelectionConfig) -> None:
        self._file, self._selection = file, selection
        self._pool, self._templates = LandmarkTable(file), TemplateCache(file, selection.cache_mb)
        self._region: CandidateRegion | None = None
        self.path, meta = file.path, file.meta
        self.world_origin: GeodeticPoint | None = meta.world_origin
        self.patch_px, self.levels = meta.patch_px, meta.levels
        self.landmark_count, self.view_count = meta.landmarks, meta.views

    @classmethod
    def open(cls, path: Path | str, selection: SelectionConfig | None = None) -> Self:
        """Open a database; only its head is read.

        Args:
            path: The file.
            selection: Which views of a landmark suit a camera.

        Raises:
            LandmarkDatabaseError: The file is absent, empty, cut short, damaged, of another program or newer.
        """
        return cls(DatabaseFile(Path(path)), selection or SelectionConfig())

    def close(self) -> None:
        """Let the file go."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def views(
        self,
        world_T_camera: FloatArray,
        camera: Camera,
        *,
        max_landmarks: int | None = None,
        max_depth_m: float | None = None,
    ) -> LandmarkViews:
        """Landmarks in the undistorted image of a camera, each as it looked from nearest to there.

        (B) of Matsuda 2007. Nearest is said of the direction from which the landmark is seen and of the size
        at which it appears; a landmark that was only seen from elsewhere is left out.

        Args:
            world_T_camera: (4, 4) where the camera is believed to be.
            camera: Its intrinsics; the image is the pinhole one of the same K and size.
            max_landmarks: No more than these: reliable ones, from all parts of the image.
            max_depth_m: None further than this in front of the camera.

        Returns:
            One view per landmark, the best prospects first.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        region = self._region_around(world_T_camera[:3, 3], camera, max_depth_m)
        region_T_camera = world_T_camera.copy()
        region_T_camera[:3, 3] -= region.centre
        place = region_T_camera[:3, 3:].astype(np.float32)
        seen = visible_landmarks(region_T_camera, camera, region.points, max_depth_m)
        if max_landmarks is None:
            return self._gather(*self._suiting(place, region, seen, camera, len(seen.row)))
        few = seen.take(spread_over_image(seen.uv_px, (camera.width, camera.height), _MORE * max_landmarks))
        rows, views = self._suiting(place, region, few, camera, max_landmarks)
        if len(rows) < max_landmarks and len(few.row) < len(seen.row):
            rows, views = self._suiting(place, region, seen, camera, max_landmarks)
        return self._gather(rows, views)

    def all_views(self) -> LandmarkViews:
        """Every view of every landmark, sorted by landmark: the whole database in memory."""
        rows = self._pool.rows(self._keys())
        rows = rows[np.argsort(self._pool.landmark[rows], kind="stable")]
        count = self._pool.count[rows]
        return self._gather(np.repeat(rows, count), concatenated_ranges(np.zeros_like(count), count))

    def positions(self) -> FloatArray:
        """(L, 3) where the landmarks are, metres, in no particular order."""
        return self._pool.numbers[self._pool.rows(self._keys()), :3]

    def keyframes(self) -> tuple[Keyframe, ...]:
        """Frames by which a camera without any pose finds its place again, in order."""
        named = {column for _, column, *_ in self._file.rows("PRAGMA table_info(keyframe)")}
        crc = "check_sum" if "check_sum" in named else "NULL"
        rows = self._file.rows(f"SELECT {KEYFRAME_COLUMNS}, {crc} FROM keyframe ORDER BY id")
        try:
            return tuple(decode_keyframe(*row) for row in rows)
        except (TypeError, ValueError) as error:
            raise self._file.damaged("keyframes") from error

    def sources(self) -> tuple[Source, ...]:
        """The runs that it was made from."""
        rows = self._file.rows(f"SELECT {SOURCE_COLUMNS} FROM source ORDER BY id")
        return tuple(Source(*row) for row in rows)

    def contents(self) -> DatabaseContents:
        """Everything, in memory."""
        return DatabaseContents(self.world_origin, self.all_views(), self.keyframes(), self.sources())

    def verify(self) -> str:
        """Look through the whole file; the SHA-256 of its contents.

        Raises:
            LandmarkDatabaseError: Something in it is not as it was written.
        """
        return self._file.verify()

    def _keys(self) -> list[int]:
        return [key for (key,) in self._file.rows("SELECT id FROM cell_box ORDER BY id")]

    def _region_around(self, place: FloatArray, camera: Camera, max_depth_m: float | None) -> CandidateRegion:
        """What may be of use from there: what was found last, as long as the camera has not gone far."""
        seen_by = optics(camera, max_depth_m)
        if self._region is None or not self._region.serves(place, seen_by):
            self._region = find_candidates(place.copy(), seen_by, self._file, self._pool, self._selection)
        return self._region

    def _suiting(
        self, place: Float32Array, region: CandidateRegion, seen: VisibleLandmarks, camera: Camera, count: int
    ) -> tuple[IntArray, IntArray]:
        """Rows of the pool of up to ``count`` landmarks, and of each the view that suits best."""
        rows = region.rows[seen.row]
        to_camera = place - region.points[:3].take(seen.row, axis=1)
        best = best_views(
            to_camera, seen.pixel_m, self._pool.view_geometry.take(rows, axis=0), self._selection
        )
        usable = np.flatnonzero(best.view >= 0)
        if len(usable) > count:
            ranking_cost = best.ranking_cost(seen.pixel_m, *self._pool.numbers.take(rows, axis=0)[:, 3:].T)[
                usable
            ]
            usable = usable[np.argsort(ranking_cost, kind="stable")]
            usable = usable[spread_over_image(seen.uv_px[:, usable], (camera.width, camera.height), count)]
        return rows[usable], best.view[usable]

    def _gather(self, rows: IntArray, views: IntArray) -> LandmarkViews:
        """Views (N,), counted within their landmarks, of landmarks in rows (N,) of the pool."""
        of_landmark = self._pool.numbers[rows]
        of_view = self._pool.view_numbers[self._pool.first[rows] + views]
        return LandmarkViews(
            landmark=self._pool.landmark[rows],
            world_p_landmark=of_landmark[:, :3],
            world_p_camera=of_view[:, :3],
            world_v_column=of_view[:, 3:6],
            world_v_row=of_view[:, 6:],
            templates=self._templates.take(rows, views),
            sigma_px=of_landmark[:, 3],
            position_sigma_m=of_landmark[:, 4],
        )
