"""The order of stage D's solutions."""

from vgps.config import BatchConfig, Config, GpsConfig
from vgps.smoothing.stage_d.rounds import Stage, stages


def made(rounds):
    """The solutions for walls of exponent 4."""
    return list(
        stages(Config(gps=GpsConfig(error_model="independent", n=4), batch=BatchConfig(rounds=rounds)))
    )


def test_the_first_round_raises_the_exponent_and_its_last_solution_ends_it():
    assert made(3) == [
        Stage(first=True, last=False, ends_round=False, n=1),
        Stage(first=True, last=False, ends_round=False, n=2),
        Stage(first=True, last=False, ends_round=True, n=4),
        Stage(first=False, last=False, ends_round=True, n=4),
        Stage(first=False, last=True, ends_round=True, n=4),
    ]


def test_the_only_round_is_first_and_last():
    assert [(stage.first, stage.last, stage.n) for stage in made(1)] == [(True, True, n) for n in (1, 2, 4)]
