"""The landmark database, opened for reading."""

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vgps.config import SelectionConfig
from vgps.landmarks.candidate_region import CandidateRegion, Optics, find_candidates
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.landmark_table import LandmarkTable
from vgps.landmarks.model import Keyframe, LandmarkViews, Source
from vgps.landmarks.schema import KEYFRAME_COLUMNS, SOURCE_COLUMNS, decode_keyframe, decode_source
from vgps.landmarks.template_cache import TemplateCache
from vgps.landmarks.view_selection import VisibleLandmarks, best_views, spread_over_image, visible_landmarks
from vgps.model import Camera, FloatArray, GeodeticPoint, IntArray

_CANDIDATES = 2  # landmarks whose views are compared, per landmark wanted


class LandmarkDatabase:
    """A landmark database, opened for reading; a context manager, for use in one thread.

    Attributes:
        path: The file.
        world_origin: Origin of the ENU frame of all positions; None where control points alone define it.
        schema_version: Of the file.
        patch_px, levels: Side of the templates, and number of their scales.
        landmark_count, view_count: Numbers of landmarks and of their views.
    """

    def __init__(self, file: DatabaseFile, selection: SelectionConfig) -> None:
        self._file, self._selection = file, selection
        self._table, self._templates = LandmarkTable(file), TemplateCache(file, selection.cache_mb)
        self._region: CandidateRegion | None = None
        self.path, self.schema_version, meta = file.path, file.schema_version, file.meta
        self.world_origin: GeodeticPoint | None = meta.world_origin
        self.patch_px, self.levels = meta.patch_px, meta.levels
        self.landmark_count, self.view_count = meta.landmarks, meta.views

    @classmethod
    def open(cls, path: Path | str, selection: SelectionConfig | None = None) -> Self:
        """Open a database; only its header is read.

        Args:
            path: The file.
            selection: Which views of a landmark suit a camera.

        Raises:
            LandmarkDatabaseError: The file is absent, empty, truncated, damaged, not a landmark database, or
                newer than this program.
        """
        return cls(DatabaseFile(Path(path)), selection or SelectionConfig())

    def close(self) -> None:
        """Close the file."""
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
        """Return the best view of each landmark in the undistorted image of a camera; (B) of Matsuda 2007.

        The best view is the closest in viewing direction and in scale. Landmarks without a view that suits
        the camera are left out.

        Args:
            world_T_camera: (4, 4) predicted pose.
            camera: Its intrinsics; the image is that of a pinhole camera of the same K and size.
            max_landmarks: At most this many: reliable ones, from all parts of the image.
            max_depth_m: Only landmarks no farther than this in front of the camera.

        Returns:
            One view per landmark, most promising first.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        region = self._region_around(world_T_camera[:3, 3], camera, max_depth_m)
        region_T_camera = world_T_camera.copy()
        region_T_camera[:3, 3] -= region.centre
        visible = visible_landmarks(region_T_camera, camera, region.points, max_depth_m)
        if max_landmarks is None:
            return self._views(*self._best(region_T_camera, region, visible, camera, len(visible.row)))
        size = (camera.width, camera.height)
        few = visible.take(spread_over_image(visible.uv_px, size, _CANDIDATES * max_landmarks))
        rows, views = self._best(region_T_camera, region, few, camera, max_landmarks)
        if len(rows) < max_landmarks and len(few.row) < len(visible.row):
            rows, views = self._best(region_T_camera, region, visible, camera, max_landmarks)
        return self._views(rows, views)

    def positions(self) -> FloatArray:
        """Return the positions (L, 3) of all landmarks, metres, in file order."""
        cells = [cell for (cell,) in self._file.rows("SELECT id FROM cell_box ORDER BY id")]
        return self._table.numbers[self._table.rows(cells), :3]

    def keyframes(self) -> tuple[Keyframe, ...]:
        """Return the keyframes, in order.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        crc = self._column("keyframe", "check_sum")
        records = self._file.rows(f"SELECT {KEYFRAME_COLUMNS}, {crc} FROM keyframe ORDER BY id")
        try:
            return tuple(decode_keyframe(record) for record in records)
        except (TypeError, ValueError) as error:
            raise self._file.damaged("keyframes") from error

    def sources(self) -> tuple[Source, ...]:
        """Return the runs that the database was built from.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        cameras = ", ".join(self._column("source", name) for name in ("cameras", "check_sum"))
        records = self._file.rows(f"SELECT {SOURCE_COLUMNS}, {cameras} FROM source ORDER BY id")
        try:
            return tuple(decode_source(record) for record in records)
        except (TypeError, ValueError) as error:
            raise self._file.damaged("cameras of its runs") from error

    def _column(self, table: str, name: str) -> str:
        """Return the name of a column, or NULL in early files that lack it."""
        columns = {column for _, column, *_ in self._file.rows(f"PRAGMA table_info({table})")}
        return name if name in columns else "NULL"

    def verify(self) -> str:
        """Check the whole file and return the SHA-256 of its contents.

        Raises:
            LandmarkDatabaseError: The contents differ from what was written.
        """
        return self._file.verify()

    def _region_around(
        self, position: FloatArray, camera: Camera, max_depth_m: float | None
    ) -> CandidateRegion:
        """Return the last candidate region while it serves the camera, else a new one around it."""
        optics = Optics.of(camera, max_depth_m)
        if self._region is None or not self._region.serves(position, optics):
            self._region = find_candidates(position.copy(), optics, self._file, self._table, self._selection)
        return self._region

    def _best(
        self,
        region_T_camera: FloatArray,
        region: CandidateRegion,
        visible: VisibleLandmarks,
        camera: Camera,
        count: int,
    ) -> tuple[IntArray, IntArray]:
        """Return table rows of up to ``count`` landmarks, and the best view of each."""
        rows = region.rows[visible.row]
        position = region_T_camera[:3, 3:].astype(np.float32)
        to_camera = position - region.points[:3].take(visible.row, axis=1)
        geometry = self._table.view_geometry.take(rows, axis=0)
        best = best_views(to_camera, visible.pixel_m, geometry, self._selection)
        usable = np.flatnonzero(best.view >= 0)
        if len(usable) > count:
            sigma_px, position_sigma_m = self._table.numbers.take(rows, axis=0)[:, 3:].T
            cost = best.ranking_cost(visible.pixel_m, sigma_px, position_sigma_m)[usable]
            usable = usable[np.argsort(cost, kind="stable")]
            size = (camera.width, camera.height)
            usable = usable[spread_over_image(visible.uv_px[:, usable], size, count)]
        return rows[usable], best.view[usable]

    def _views(self, rows: IntArray, views: IntArray) -> LandmarkViews:
        return gather_views(self._table, self._templates, rows, views)


def gather_views(
    table: LandmarkTable, templates: TemplateCache, rows: IntArray, views: IntArray
) -> LandmarkViews:
    """Collect views from the table and the templates.

    Args:
        table: Landmarks in ``rows`` must have been read.
        templates: Of the same file.
        rows: (N,) rows of the table.
        views: (N,) view of each, counted within its landmark.
    """
    of_landmark = table.numbers[rows]
    of_view = table.view_numbers[table.first[rows] + views]
    return LandmarkViews(
        landmark=table.landmark[rows],
        world_p_landmark=of_landmark[:, :3],
        world_p_camera=of_view[:, :3],
        world_v_column=of_view[:, 3:6],
        world_v_row=of_view[:, 6:],
        templates=templates.take(rows, views),
        sigma_px=of_landmark[:, 3],
        position_sigma_m=of_landmark[:, 4],
    )
