"""Wall time, stage by stage; what runs beside other stages is marked so."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

BESIDE = " beside"  # ends the name of a stage that ran in a thread of its own


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


def one_after_another(by_stage: Mapping[str, float]) -> float:
    """Wall seconds of all stages together: those that ran beside others do not add up."""
    return sum(seconds for stage, seconds in by_stage.items() if not stage.endswith(BESIDE))
