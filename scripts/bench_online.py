"""Latency, memory and error of the online mode over a long drive: a recording to and fro, with an outage.

python scripts/bench_online.py RECORDING --gps gps_float.nmea [--frames 10000] [--section 400] [--outage 30]
    [--late 0.4] [--plot out.png]

The first frames of the recording are played forwards, backwards, forwards ... Fixes are its true antenna at
1 Hz with the errors of its log, and come late. The error is that of each pose as it came, against the truth.
"""

import argparse
import resource
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from to_and_fro import ToAndFro

import vgps


@dataclass
class Measured:
    """A row for every frame."""

    pose_s: list[float] = field(default_factory=list)
    refine_s: list[float] = field(default_factory=list)
    error_m: list[float] = field(default_factory=list)
    smooth_error_m: list[float] = field(default_factory=list)
    step_m: list[float] = field(default_factory=list)
    memory_mb: list[float] = field(default_factory=list)
    t_s: list[float] = field(default_factory=list)
    fix_error_m: float = 0.0

    def table(self, rows: slice, name: str) -> str:
        """A line of Markdown on some frames."""
        pose, refine = np.array(self.pose_s[rows]), np.array(self.refine_s[rows])
        busy = pose + refine
        figures = [
            *(1e3 * np.percentile(pose, [50, 99])),
            *(1e3 * np.percentile(busy, [50, 99])),
            1.0 / busy.mean(),
            np.nanmean(self.error_m[rows]),
            np.nanmax(self.error_m[rows]),
            np.nanmax(self.step_m[rows]),
            self.memory_mb[rows][-1],
        ]
        return f"| {name} | " + " | ".join(f"{x:.3g}" for x in figures) + " |"


def drive(given: argparse.Namespace) -> tuple[Measured, list[str]]:
    """Feed the smoother, and measure."""
    recording = vgps.open_recording(given.recording, gps=given.gps)
    source, smoother = (
        ToAndFro(recording, given.section),
        vgps.OnlineSmoother(recording.camera, recording.rig),
    )
    found, told, second, smooth_before = Measured(), list[str](), 0, np.full(3, np.nan)
    clock = time.process_time if given.cpu else time.perf_counter
    found.fix_error_m = source.fix_error_m
    silent = given.frames * source.interval_s * 0.5
    for index in range(given.frames):
        t_s, image, true = source.frame(index)
        while source.fix(second).t_s + given.late <= t_s:
            fix = source.fix(second)
            if not silent <= fix.t_s < silent + given.outage:
                smoother.add_fix(fix)
            second += 1
        begun = clock()
        estimate = smoother.add_frame(t_s, image)
        posed = clock()
        smoother.refine()
        found.refine_s.append(clock() - posed)
        found.pose_s.append(posed - begun)
        found.t_s.append(t_s)
        error = estimate.global_T_camera[:3, 3] - true[:3, 3]
        smooth = estimate.local_T_camera[:3, 3]
        found.error_m.append(float(np.linalg.norm(error)))
        found.smooth_error_m.append(float(np.linalg.norm(smooth - true[:3, 3])))
        found.step_m.append(float(np.linalg.norm(smooth - smooth_before)))
        smooth_before = smooth
        found.memory_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        told += [f"{event.t_s:8.1f} s  {event.kind}: {event.text}" for event in estimate.events]
    return found, told


def plot(found: Measured, path: Path) -> None:
    """Errors and latency over time."""
    import matplotlib  # noqa: PLC0415

    matplotlib.use("agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(9, 5), layout="constrained")
    axes[0].plot(found.t_s, found.error_m, label="corrected", lw=1)
    axes[0].plot(found.t_s, found.smooth_error_m, label="smooth", lw=1)
    axes[0].set_ylabel("error as it came [m]")
    axes[0].legend()
    axes[1].plot(found.t_s, 1e3 * np.array(found.pose_s), label="until the pose is known", lw=0.6)
    axes[1].plot(found.t_s, 1e3 * np.array(found.refine_s), label="stage C after it", lw=0.6)
    axes[1].set(ylabel="ms", xlabel="s", yscale="log", ylim=(1, None))
    axes[1].legend()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print a row for the first and the last frames."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--gps", default="gps_float.nmea")
    parser.add_argument("--frames", type=int, default=10000)
    parser.add_argument("--section", type=int, default=400)
    parser.add_argument("--outage", type=float, default=30.0, help="seconds, in the middle")
    parser.add_argument("--late", type=float, default=0.4, help="seconds by which fixes come late")
    parser.add_argument("--cpu", action="store_true", help="seconds of the processor, for a busy machine")
    parser.add_argument("--events", action="store_true", help="print what happened, but for the fixes used")
    parser.add_argument("--plot", type=Path)
    given = parser.parse_args()
    found, told = drive(given)
    part = min(1000, given.frames // 3)
    print("| frames | pose p50 [ms] | p99 | with stage C p50 | p99 | frames/s | error mean [m] | max | "
          "largest smooth step [m] | peak memory [MB] |\n" + "|---" * 10 + "|")  # fmt: skip
    print(found.table(slice(0, part), f"first {part}"))
    print(found.table(slice(len(found.t_s) - part, None), f"last {part}"))
    print(found.table(slice(None), "all"))
    print(f"\nThe fixes' own error is {found.fix_error_m:.2f} m in the mean.")
    if given.events:
        print("\n".join(line for line in told if not line.endswith(" used")))
    if given.plot:
        plot(found, given.plot)


if __name__ == "__main__":
    main()
