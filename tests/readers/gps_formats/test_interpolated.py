"""Fixes that a program interpolated are told from those of a receiver."""

import numpy as np
import pytest

from vgps.geodesy import to_geodetic
from vgps.model import FixClass, GeodeticPoint
from vgps.readers.gps_formats.fixes import Fix
from vgps.readers.gps_formats.interpolated import without_interpolated

ORIGIN = GeodeticPoint(49.0, 8.4, 120.0)


def log(t_s, place_m):
    degrees = to_geodetic(ORIGIN, place_m).tolist()
    rows = zip(t_s.tolist(), degrees, strict=True)
    return [Fix(at, *place, FixClass.RTK_FIX, line) for line, (at, place) in enumerate(rows, 1)]


def measured(t_s, seed=0):
    """Places (n, 3) of a car that turns, with errors of a centimetre."""
    noise_m = 0.01 * np.random.default_rng(seed).normal(size=(len(t_s), 3))
    turn = np.stack([50.0 * np.sin(0.2 * t_s), 50.0 * np.cos(0.2 * t_s), 0.1 * t_s], axis=1)
    return turn + noise_m


@pytest.mark.parametrize("rate_hz", [10.0, 29.97])
@pytest.mark.parametrize("first_s", [0.0, 0.013])
def test_fixes_of_every_frame_are_those_next_to_the_receivers(rate_hz, first_s):
    """Whether the receiver measured at the times of frames or between them."""
    fix_s = np.arange(0.0, 30.0)
    t_s = np.arange(first_s, 29.0, 1.0 / rate_hz)
    places = np.stack([np.interp(t_s, fix_s, axis) for axis in measured(fix_s).T], axis=1)
    fixes = log(t_s, places)
    kept, notes = without_interpolated(fixes)
    at_s = np.array([fix.t_s for fix in kept])
    assert abs(at_s - np.round(at_s))[:-1].max() < 1.0 / rate_hz + 1e-9  # the last ends the video
    assert len(np.unique(np.round(at_s))) >= 28
    assert notes == [f"{len(fixes) - len(kept)} fixes interpolated between others skipped"]


@pytest.mark.parametrize(
    "fixes",
    [
        log(0.1 * np.arange(300), measured(0.1 * np.arange(300))),  # a receiver at 10 Hz
        log(0.1 * np.arange(300), np.outer(np.arange(300.0), [1.0, 0.5, 0.0])),  # without any errors
        # stands for most of the time at the very same place, then drives
        log(
            0.1 * np.arange(300),
            np.where(np.arange(300)[:, None] < 200, measured(np.zeros(1)), measured(0.1 * np.arange(300))),
        ),
        # an inertial path at 100 Hz, corrected every second
        log(
            0.01 * np.arange(2000),
            measured(np.zeros(1))
            + np.stack(
                [20.0 * np.sin(0.005 * np.arange(2000.0)), np.arange(2000.0) // 100 * 0.03, np.zeros(2000)],
                axis=1,
            ),
        ),
        log(np.arange(4.0), measured(np.arange(4.0))),
        [],
    ],
)
def test_other_logs_keep_their_fixes(fixes):
    assert without_interpolated(fixes) == (fixes, [])
