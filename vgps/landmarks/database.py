"""The landmark database, read: which landmarks a camera sees, and how they looked from near there."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from vgps.landmarks.build_settings import SelectionConfig
from vgps.landmarks.cell_store import CellStore, LoadedCell
from vgps.landmarks.contents import Keyframe, LandmarkContents, Source
from vgps.landmarks.opening import DatabaseFile
from vgps.landmarks.schema import KEYFRAME_COLUMNS, decode_keyframe
from vgps.landmarks.selection import best_views, focal_px, in_image, slabs, spread
from vgps.landmarks.views import LandmarkViews
from vgps.model import Camera, FloatArray, GeodeticPoint, IntArray

_IN_VIEW = """
SELECT id FROM cell_box
WHERE east_1 >= ? AND east_0 <= ? AND north_1 >= ? AND north_0 <= ? AND up_1 >= ? AND up_0 <= ?
AND pixel_1 >= ? AND pixel_0 <= ?
"""


@dataclass(frozen=True)
class _Chosen:
    """Views of one cell: ``landmark`` (n,) rows of its landmarks, ``view`` (n,) rows of its views."""

    key: int
    landmark: IntArray
    view: IntArray


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
        self._store = CellStore(file, selection.cache_mb)
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
            One view per landmark, sorted by landmark.

        Raises:
            LandmarkDatabaseError: The file is damaged.
        """
        keys = self._cells_in_view(world_T_camera, camera, max_depth_m)
        if not keys:
            return self._gather([])
        cells = [self._store.cell(key) for key in keys]
        numbers = np.concatenate([loaded.cell.numbers for loaded in cells])
        seen = in_image(world_T_camera, camera, numbers[:, :3], max_depth_m)
        looks = np.concatenate([loaded.looks for loaded in cells])[seen.row]
        best = best_views(seen, looks, self._selection)
        usable = np.flatnonzero(best.view >= 0)
        if max_landmarks is not None:
            badness = best.badness(seen, numbers[seen.row])[usable]
            usable = usable[spread(seen.uv_px[usable], badness, camera, max_landmarks)]
        return self._gather(_by_cell(keys, cells, seen.row[usable], best.view[usable]))

    def all_views(self) -> LandmarkViews:
        """Every view of every landmark, sorted by landmark: the whole database in memory."""
        return self._gather(map(self._all_of, self._keys()))

    def positions(self) -> FloatArray:
        """(L, 3) where the landmarks are, metres, in no particular order."""
        return np.concatenate([self._store.cell(key).cell.numbers[:, :3] for key in self._keys()])

    def keyframes(self) -> tuple[Keyframe, ...]:
        """Frames by which a camera without any pose finds its place again, in order."""
        rows = self._file.rows(f"SELECT {KEYFRAME_COLUMNS} FROM keyframe ORDER BY id")
        try:
            return tuple(decode_keyframe(*row) for row in rows)
        except (TypeError, ValueError) as error:
            raise self._file.damaged("keyframes") from error

    def sources(self) -> tuple[Source, ...]:
        """The runs that it was made from."""
        rows = self._file.rows("SELECT recording, frames, landmarks FROM source ORDER BY id")
        return tuple(Source(*row) for row in rows)

    def contents(self) -> LandmarkContents:
        """Everything, in memory."""
        return LandmarkContents(self.world_origin, self.all_views(), self.keyframes(), self.sources())

    def verify(self) -> str:
        """Look through the whole file; the SHA-256 of its contents.

        Raises:
            LandmarkDatabaseError: Something in it is not as it was written.
        """
        return self._file.verify()

    def _keys(self) -> list[int]:
        return [key for (key,) in self._file.rows("SELECT id FROM cell ORDER BY id")]

    def _all_of(self, key: int) -> _Chosen:
        count = self._store.cell(key).cell.count
        return _Chosen(key, np.repeat(np.arange(len(count)), count), np.arange(count.sum()))

    def _cells_in_view(
        self, world_T_camera: FloatArray, camera: Camera, max_depth_m: float | None
    ) -> list[int]:
        """Cells that may hold landmarks in view at a scale that suits."""
        smaller, larger = 2.0**-self._selection.nearer_octaves, 2.0**self._selection.further_octaves
        focal, (finest, coarsest) = focal_px(camera), self._file.meta.pixel_m
        near_m, far_m = focal * finest * smaller, focal * coarsest * larger
        if max_depth_m is not None:
            far_m = min(far_m, max_depth_m)
        found: set[int] = set()
        for depth_m, box in zip(*slabs(world_T_camera, camera, near_m, far_m), strict=True):
            scales = (depth_m[0] / focal / larger, depth_m[1] / focal / smaller)
            found.update(key for (key,) in self._file.rows(_IN_VIEW, (*box.T.ravel().tolist(), *scales)))
        return sorted(found)

    def _gather(self, chosen: Iterable[_Chosen]) -> LandmarkViews:
        """The views chosen, sorted by landmark."""
        side = self.patch_px
        landmark, numbers = [np.zeros(0, np.int64)], [np.zeros((0, 5))]
        views, templates = [np.zeros((0, 9))], [np.zeros((0, self.levels, side, side), np.uint8)]
        for part in chosen:
            cell = self._store.cell(part.key).cell
            landmark.append(cell.landmark[part.landmark])
            numbers.append(cell.numbers[part.landmark])
            views.append(cell.view_numbers[part.view])
            templates.append(self._store.templates(part.key)[part.view])
        ids = np.concatenate(landmark)
        order = np.argsort(ids, kind="stable")
        of_landmark, of_view = np.concatenate(numbers)[order], np.concatenate(views)[order]
        return LandmarkViews(
            landmark=ids[order],
            world_p_landmark=of_landmark[:, :3],
            world_p_camera=of_view[:, :3],
            world_v_column=of_view[:, 3:6],
            world_v_row=of_view[:, 6:],
            templates=np.concatenate(templates)[order],
            sigma_px=of_landmark[:, 3],
            position_sigma_m=of_landmark[:, 4],
        )


def _by_cell(keys: list[int], cells: list[LoadedCell], row: IntArray, view: IntArray) -> list[_Chosen]:
    """Rows (n,) of the landmarks of all cells one after the other, ascending, as rows of each cell."""
    ends = np.cumsum([len(loaded.first) for loaded in cells])
    cuts = np.searchsorted(row, ends)
    chosen = []
    start, begin = 0, 0
    for key, loaded, stop, end in zip(keys, cells, cuts.tolist(), ends.tolist(), strict=True):
        if stop > start:
            local = row[start:stop] - begin
            chosen.append(_Chosen(key, local, loaded.first[local] + view[start:stop]))
        start, begin = stop, end
    return chosen
