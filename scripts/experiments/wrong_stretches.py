"""Is a stretch of wrong fixes found, however often the receiver measures?

The errors of real receivers are replayed on recordings with truth, and in one stretch of some seconds, drawn
by the seed, all fixes are moved by the same vector, as by a reflection or wrong integers. The same log is
also taken with fewer fixes a second. Errors are unaligned; those of the fixes include the moved ones. Doubted
are fixes that were rejected or taken for those of a coarser class. Live are the poses of `vgps online` as
they came, with the share of them that is beyond three of their standard deviations.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.drives import Drive, open_drive
from scripts.common.live_runs import add_delay, run_live, score, truth_of
from scripts.common.markdown import LiveTable
from scripts.common.replayed_errors import REPLAYED, make_errors
from vgps.errors import GpsLogError
from vgps.evaluation import evaluate
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import BoolArray, GpsLog
from vgps.solution import Verdict

RECORDINGS = ("kitti03",)
SOURCES = ("septentrio", "kitti03_more/gps_moving.nmea")
DOUBTED = (Verdict.REJECTED, Verdict.DOWN_CLASSED)
LIVE = ("mean_m", "max_m", "nees", "beyond_three_sigmas")
_EDGE = 0.15  # of the recording at either end, where no wrong stretch begins or ends


def thinned(log: GpsLog, rate_hz: float) -> GpsLog:
    """Return the first fix of each interval of so many a second."""
    interval = np.floor(log.t_s * rate_hz + 1e-6)
    return log.rows(np.diff(interval, prepend=-np.inf) > 0)


def with_wrong_stretch(
    log: GpsLog, drive: Drive, moved_m: float, seconds: float, rng: np.random.Generator
) -> tuple[GpsLog, BoolArray]:
    """Return the log with a stretch of its fixes moved by one vector, and which (M,) they are."""
    first_s = rng.uniform(_EDGE * drive.duration_s, (1.0 - _EDGE) * drive.duration_s - seconds)
    away = rng.normal(size=3)
    wrong = (log.t_s >= first_s) & (log.t_s < first_s + seconds)
    place = to_enu(drive.origin, log.latitude_deg, log.longitude_deg, log.height_m)
    place[wrong] += moved_m * away / np.linalg.norm(away)
    latitude_deg, longitude_deg, height_m = to_geodetic(drive.origin, place).T
    return replace(log, latitude_deg=latitude_deg, longitude_deg=longitude_deg, height_m=height_m), wrong


def row(drive: Drive, log: GpsLog, wrong: BoolArray, seed: int) -> dict[str, Any]:
    """Smooth a recording with a log; return errors and verdicts."""
    solution = vgps.smooth(replace(drive.recording, gps=log), vgps.Config(seed=seed))
    errors, verdicts = evaluate(solution, drive.truth), solution.fixes
    assert verdicts is not None  # there was a log
    doubted = np.array([verdict in DOUBTED for verdict in verdicts.verdict])
    return {
        "wrong": int(wrong.sum()),
        "missed": int((wrong & ~doubted).sum()),
        "good": int((~wrong).sum()),
        "good_doubted": int((doubted & ~wrong).sum()),
        "fixes_mean_m": float(np.nanmean(np.linalg.norm(drive.errors(log), axis=1))),
        "mean_m": errors.camera_position_m.mean,
        "max_m": errors.camera_position_m.max,
        "nees": None if errors.nees is None else errors.nees.mean,
    }


def live_row(drive: Drive, log: GpsLog, seed: int, delay_s: float = 0.0) -> dict[str, Any]:
    """Run a recording with a log live; return the errors of poses as they came."""
    recording = replace(drive.recording, gps=log)
    found = score(recording, truth_of(recording), run_live(recording, seed, delay_s))
    return {f"live_{key}": found[key] for key in LIVE}


def rows(given: argparse.Namespace, scratch: Path) -> Iterator[dict[str, Any]]:
    """Yield a row per recording, source that it has, size of the error, seed and rate."""
    for name in given.recordings:
        drive = open_drive(name, given.data, scratch)
        sources = [source for source in given.sources if source in {*REPLAYED, *drive.shipped()}]
        if not sources:
            known = ", ".join([*REPLAYED, *drive.shipped()])
            raise GpsLogError(f"none of {', '.join(given.sources)}", file=drive.folder, expected=known)
        for source, moved_m, seed in product(sources, given.moved, range(given.seeds)):
            errors, rng = make_errors(source, drive, given.data, seed), np.random.default_rng(seed)
            log, wrong = with_wrong_stretch(errors.log, drive, moved_m, given.seconds, rng)
            for rate_hz in given.rates:
                few = thinned(log, rate_hz)
                chosen = np.isin(log.t_s, few.t_s)
                yield {
                    "recording": name,
                    "source": source,
                    "moved_m": moved_m,
                    "seed": seed,
                    "rate_hz": rate_hz,
                    **row(drive, few, wrong[chosen], seed),
                    **(live_row(drive, few, seed, given.delay_s) if given.live else {}),
                }


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("recordings", nargs="*", default=list(RECORDINGS), help="with truth, or simulated")
    parser.add_argument(
        "--sources",
        nargs="+",
        default=list(SOURCES),
        help=f"{', '.join(REPLAYED)}, or logs that ship with a recording",
    )
    parser.add_argument("--moved", nargs="+", type=float, default=[3.0, 12.0], help="metres")
    parser.add_argument("--seconds", type=float, default=8.0, help="duration of the wrong stretch")
    parser.add_argument("--rates", nargs="+", type=float, default=[1.0, 10.0], help="fixes a second")
    parser.add_argument("--live", action="store_true", help="run `vgps online` too")
    add_delay(parser)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the recordings")
    add_seeds(parser, 2)
    return parser.parse_args()


def main() -> None:
    """Print a markdown table."""
    parser = ScriptParser("experiments.wrong_stretches", __doc__)
    given = arguments(parser)
    labels = ("recording", "receiver", "moved [m]", "seed", "fixes a second", "missed", "good ones doubted")
    measures = ("mean [m]", "max [m]", "NEES")
    live = [f"live {name}" for name in (*measures, "beyond")] if given.live else []
    table = LiveTable(*labels, "fixes [m]", *measures, *live)
    with parser.refusals(), TemporaryDirectory() as scratch:
        results = parser.results(given)
        for one in rows(given, Path(scratch)):
            results.add(**one)
            table.add(
                *(one["recording"], one["source"], f"{one['moved_m']:g}", str(one["seed"])),
                f"{one['rate_hz']:g}",
                f"{one['missed']} of {one['wrong']}",
                f"{one['good_doubted']} of {one['good']}",
                *(f"{one[key]:.3f}" for key in ("fixes_mean_m", "mean_m", "max_m")),
                "" if one["nees"] is None else f"{one['nees']:.1f}",
                *(f"{one[f'live_{key}']:.3g}" for key in LIVE if given.live),
            )


if __name__ == "__main__":
    main()
