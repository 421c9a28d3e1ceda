"""A saved recording as plain Python values."""

from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader


class Logged:
    """Everything that a ``.rrd`` file holds, by entity and component (``Cylinders3D:radii``)."""

    def __init__(self, file: Path) -> None:
        self._chunks = list(RrdReader(file).stream())

    @property
    def entities(self) -> set[str]:
        return {str(chunk.entity_path) for chunk in self._chunks}

    def rows(self, entity: str, component: str) -> list[Any]:
        """The component's value in each row, in order of the frames."""
        found = []
        for chunk in self._chunks:
            batch = chunk.to_record_batch()
            if str(chunk.entity_path) == entity and component in batch.schema.names:
                names = batch.schema.names
                keys = (
                    batch.column(names.index("frame")).to_pylist() if "frame" in names else [0] * len(batch)
                )
                found += list(zip(keys, batch.column(names.index(component)).to_pylist(), strict=True))
        return [value for _, value in sorted(found, key=lambda row: row[0])]

    def timelines(self, entity: str) -> set[str]:
        return {name for c in self._chunks if str(c.entity_path) == entity for name in c.timeline_names}

    def times_s(self, entity: str) -> list[float]:
        batches = [
            c.to_record_batch() for c in self._chunks if str(c.entity_path) == entity and not c.is_static
        ]
        return [
            t.total_seconds() for b in batches for t in b.column(b.schema.names.index("time")).to_pylist()
        ]

    def frames(self, entity: str) -> list[int]:
        batches = [
            c.to_record_batch() for c in self._chunks if str(c.entity_path) == entity and not c.is_static
        ]
        return [frame for b in batches for frame in b.column(b.schema.names.index("frame")).to_pylist()]


def packed(colour: tuple[int, ...]) -> int:
    """The colour as rerun stores it."""
    red, green, blue, alpha = colour
    return red << 24 | green << 16 | blue << 8 | alpha
