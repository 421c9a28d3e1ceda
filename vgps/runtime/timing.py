"""Wall time per stage; stages that run in a thread of their own are marked as concurrent."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

CONCURRENT = " beside"  # suffix of a stage that ran in a thread of its own


@dataclass
class StageTimer:
    """Wall seconds per stage."""

    by_stage: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Add the time of a ``with`` block to a stage."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self.by_stage[stage] = self.by_stage.get(stage, 0.0) + time.perf_counter() - begun


def sequential_seconds(by_stage: Mapping[str, float]) -> float:
    """Return the wall seconds of all stages that ran one after another, without the concurrent ones."""
    return sum(seconds for stage, seconds in by_stage.items() if not stage.endswith(CONCURRENT))
