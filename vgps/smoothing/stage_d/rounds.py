"""The solutions of stage D in their order."""

from collections.abc import Iterator
from dataclasses import dataclass

from factors import exponent_schedule
from vgps.config import Config


@dataclass(frozen=True)
class Stage:
    """Whether a solution is of the first or the last round and ends it, and the exponent of its GPS walls."""

    first: bool
    last: bool
    ends_round: bool
    n: int


def stages(config: Config) -> Iterator[Stage]:
    """Yield the solutions of all rounds: the first one raises the exponent in stages."""
    exponent, rounds = config.gps.exponent, config.batch.rounds
    for round_ in range(rounds):
        for n in exponent_schedule(exponent) if round_ == 0 else [exponent]:
            yield Stage(round_ == 0, round_ == rounds - 1, n == exponent, n)
