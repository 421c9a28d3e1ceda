"""Does `vgps smooth` hold on scenes, cameras and receivers that nobody chose?

Each seed draws a scene, a camera (lens, shutter, tilt, shaking hand, compression), a receiver whose errors
are replayed, its clock, and what the user lacks: camera.yaml, the lever arm, the receiver's sigmas, fixes for
a quarter of the time. Errors are unaligned, those of fixes are at the times of their positions. NEES is that
of the position, 3 if the stated standard deviations are right.
"""

import argparse
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

import vgps
from scripts.common.command import ScriptParser
from scripts.common.drives import Drive, open_drive
from scripts.common.markdown import LiveTable
from scripts.common.replayed_errors import REPLAYED, make_errors
from scripts.common.scenes import half_size, shortened
from vgps.errors import GeometryError, GpsLogError
from vgps.evaluation import evaluate
from vgps.model import GpsLog, Recording
from vgps.simulate import SCENES, SceneConfig, simulate

BASES = ("walk", "drive", "drone", "orbit", "demo")
OUTAGE = 0.25  # of the recording
LATE_S = 0.5, 4.0  # of a clock that a search about zero finds, and of one that needs the shape of the path
_DRAWN = 77  # keeps these random numbers apart from those of the simulation


@dataclass(frozen=True)
class Case:
    """What a seed draws; ``lacks`` names what the user does not have."""

    base: str
    scene: SceneConfig
    source: str
    late_s: float
    lacks: frozenset[str]
    outage_at: float


def draw(seed: int) -> Case:
    """Return the case of a seed."""
    rng = np.random.default_rng([_DRAWN, seed])
    base = str(rng.choice(BASES))
    scene = half_size(SCENES[base])
    seconds = float(rng.uniform(14.0, 34.0))
    if scene.path is None:
        scene = shortened(replace(scene, fps=int(rng.choice([10, 15]))), min(seconds, scene.speed[-1][0]))
    drawn = {
        "focal_px": scene.focal_px * rng.uniform(0.7, 1.4),
        "roll_deg": rng.choice([0.0, rng.normal(0.0, 8.0)]),
        "pitch_deg": scene.pitch_deg + rng.choice([0.0, rng.uniform(-15.0, 8.0)]),
        "hand_shake": rng.choice([0.0, 0.0, 1.0]),
        "fisheye_deg": rng.choice([0.0, 0.0, 0.0, rng.uniform(90.0, 160.0)]),
        "readout_s": rng.choice([0.0, 0.0, rng.uniform(0.008, 0.03)]),
    }
    numbers: dict[str, Any] = {name: float(value) for name, value in drawn.items()}
    scene = replace(
        scene,
        **numbers,
        moving=bool(rng.random() < 0.3),
        crf=int(rng.choice([16, 23, 28])),
    )
    late_s = float(rng.choice([0.0, 0.0, 0.0, *(rng.uniform(-reach, reach) for reach in LATE_S)]))
    shares = {"camera.yaml": 0.4, "lever arm": 0.3, "sigmas": 0.3, "some fixes": 0.25}
    lacks = frozenset(name for name, share in shares.items() if rng.random() < share)
    return Case(base, scene, str(rng.choice(list(REPLAYED))), late_s, lacks, float(rng.uniform(0.2, 0.6)))


def log_of(case: Case, drive: Drive, data: Path, seed: int) -> tuple[GpsLog, float]:
    """Return the fixes of a case, and their mean error."""
    errors = make_errors(case.source, drive, data, seed)
    log = errors.log
    if "some fixes" in case.lacks:
        begin_s = case.outage_at * drive.duration_s
        log = log.rows((log.t_s < begin_s) | (log.t_s > begin_s + OUTAGE * drive.duration_s))
    mean_m = float(np.nanmean(np.linalg.norm(drive.errors(log, errors.late_s), axis=1)))
    if "sigmas" in case.lacks:
        log = replace(log, sigma_m=np.full_like(log.sigma_m, np.nan))
    return replace(log, t_s=log.t_s + case.late_s), mean_m


def as_the_user_has_it(case: Case, drive: Drive, log: GpsLog, out: Path) -> Recording:
    """Return the recording without what the user lacks."""
    out.mkdir()
    shutil.copy(drive.folder / "video.mp4", out)
    if "camera.yaml" not in case.lacks:
        shutil.copy(drive.folder / "camera.yaml", out)
    known = ["world_origin"] if "lever arm" in case.lacks else ["world_origin", "camera_p_antenna"]
    rig = yaml.safe_load((drive.folder / "rig.yaml").read_text(encoding="utf-8"))
    (out / "rig.yaml").write_text(yaml.safe_dump({name: rig[name] for name in known}), encoding="utf-8")
    return replace(vgps.open_recording(out), gps=log)


def row(seed: int, data: Path, scratch: Path) -> dict[str, Any]:
    """Simulate and smooth the case of a seed."""
    case, folder = draw(seed), scratch / f"{seed}"
    simulate(folder, case.scene, seed)
    drive = open_drive(str(folder), data, scratch)
    log, fixes_m = log_of(case, drive, data, seed)
    lens = f"fisheye {case.scene.fisheye_deg:.0f} deg" if case.scene.fisheye_deg else "pinhole"
    camera = f"{lens}, readout {1e3 * case.scene.readout_s:.0f} ms"
    found: dict[str, Any] = {
        "seed": seed,
        "scene": f"{case.base}, {drive.duration_s:.0f} s, {camera}",
        "fixes": f"{case.source}, {case.late_s:.2f} s late",
        "lacks": ", ".join(sorted(case.lacks)),
        "fixes_mean_m": fixes_m,
    }
    recording = as_the_user_has_it(case, drive, log, scratch / f"{seed}_lacking")
    try:
        solution = vgps.smooth(recording, vgps.Config(seed=seed))
    except (GeometryError, GpsLogError) as error:  # what a drawn case may lead to
        return found | {"failed": str(error)}
    errors = evaluate(solution, drive.truth)
    return found | {
        "mean_m": errors.camera_position_m.mean,
        "max_m": errors.camera_position_m.max,
        "nees": None if errors.nees is None else errors.nees.mean,
        "warnings": len(solution.warnings),
    }


def rows(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield a row per seed."""
    for seed in range(given.first, given.first + given.count):
        with TemporaryDirectory() as scratch:
            yield row(seed, given.data, Path(scratch))


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--count", type=int, default=20, help="number of seeds (default: 20)")
    parser.add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="folder of the receivers' logs"
    )
    return parser.parse_args()


def main() -> None:
    """Print a markdown table."""
    parser = ScriptParser("experiments.random_scenes", __doc__)
    given = arguments(parser)
    table = LiveTable("seed", "scene", "fixes", "lacks", "fixes [m]", "mean [m]", "max [m]", "NEES")
    with parser.refusals():
        results = parser.results(given)
        for one in rows(given):
            results.add(**one)
            named = (str(one["seed"]), one["scene"], one["fixes"], one["lacks"], f"{one['fixes_mean_m']:.3f}")
            if "failed" in one:
                table.add(*named, one["failed"], "", "")
                continue
            nees = "" if one["nees"] is None else f"{one['nees']:.1f}"
            table.add(*named, f"{one['mean_m']:.3f}", f"{one['max_m']:.3f}", nees)


if __name__ == "__main__":
    main()
