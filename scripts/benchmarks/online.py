"""Does `vgps online` keep its latency, memory and accuracy over a long drive with an outage?

The first frames of a recording are played forwards, backwards, forwards ... Fixes are its true antenna at 1
Hz with the errors of its log; they arrive late, as NMEA over TCP. In the middle there is an outage; after
three quarters the receiver's server is stopped, and started again. The error is that of each pose as it came,
against the truth, and NEES its square over the stated variance: 1 is honest, more is overconfident.
"""

import argparse
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import vgps
from scripts.common.command import ScriptParser
from scripts.common.fix_server import FixServer
from scripts.common.markdown import table
from scripts.common.memory import resident_mb
from scripts.common.ping_pong import PingPong
from vgps.model import FloatArray
from vgps.online import OnlineEstimate
from vgps.online.sources.gps_source import GpsSource
from vgps.online.sources.live_feed import VideoClock
from vgps.readers.gps_formats.fixes import unix_s

COLUMNS = {
    "pose_p50_ms": "pose p50 [ms]",
    "pose_p99_ms": "p99",
    "frame_p50_ms": "with stage C p50",
    "frame_p99_ms": "p99",
    "frames_per_s": "frames/s",
    "mean_error_m": "error mean [m]",
    "max_error_m": "max",
    "max_smooth_step_m": "largest smooth step [m]",
    "nees": "NEES",
    "memory_mb": "memory [MB]",
}


@dataclass
class FrameMeasures:
    """Columns with a row for every frame."""

    pose_s: list[float] = field(default_factory=list)
    refine_s: list[float] = field(default_factory=list)
    error_m: list[float] = field(default_factory=list)
    smooth_error_m: list[float] = field(default_factory=list)
    step_m: list[float] = field(default_factory=list)
    sigma_m: list[float] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    memory_mb: list[float] = field(default_factory=list)
    t_s: list[float] = field(default_factory=list)
    _smooth: FloatArray = field(default_factory=lambda: np.full(3, np.nan))

    def add(
        self, t_s: float, estimate: OnlineEstimate, true: FloatArray, pose_s: float, refine_s: float
    ) -> None:
        """Add a frame; ``true`` (4, 4) is its true pose."""
        self.t_s.append(t_s)
        self.pose_s.append(pose_s)
        self.refine_s.append(refine_s)
        error = estimate.global_T_camera[:3, 3] - true[:3, 3]
        before, self._smooth = self._smooth, estimate.local_T_camera[:3, 3]
        self.error_m.append(float(np.linalg.norm(error)))
        self.smooth_error_m.append(float(np.linalg.norm(self._smooth - true[:3, 3])))
        self.step_m.append(float(np.linalg.norm(self._smooth - before)))
        self.sigma_m.append(float(np.linalg.norm(estimate.sigma_position_m)))
        self.nees.append(float(np.mean((error / estimate.sigma_position_m) ** 2)))
        self.memory_mb.append(resident_mb())

    def growth(self, part: int) -> dict[str, float]:
        """Return how the last frames compare with the first ones, whose windows are full by their end."""
        pose, memory = np.array(self.pose_s), np.array(self.memory_mb)
        slower = np.median(pose[-part:]) / np.median(pose[:part])
        return {"median_pose_ratio": float(slower), "memory_growth_mb": float(memory[-1] - memory[part - 1])}

    def row(self, rows: slice) -> dict[str, float]:
        """Return the figures of some frames, by the names in ``COLUMNS``."""
        pose, refine = np.array(self.pose_s[rows]), np.array(self.refine_s[rows])
        busy = pose + refine
        figures = [
            *(1e3 * np.percentile(pose, [50, 99])),
            *(1e3 * np.percentile(busy, [50, 99])),
            1.0 / busy.mean(),
            np.nanmean(self.error_m[rows]),
            np.nanmax(self.error_m[rows]),
            np.nanmax(self.step_m[rows]),
            np.nanmean(self.nees[rows]),
            self.memory_mb[rows][-1],
        ]
        return dict(zip(COLUMNS, map(float, figures), strict=True))


class Receiver:
    """Sends each fix over TCP when it is due, and receives what has arrived.

    Args:
        source: Of the fixes.
        late_s: Delay of a fix behind its time.
        outage: Interval [s, s) without fixes.
        down: Interval [s, s) without a server.
    """

    def __init__(
        self, source: PingPong, late_s: float, outage: tuple[float, float], down: tuple[float, float]
    ) -> None:
        self._source, self._late_s, self._outage, self._down = source, late_s, outage, down
        self._server, self._second, self._alive = FixServer(), 0, True
        self._gps = GpsSource(f"tcp://127.0.0.1:{self._server.port}")
        self._clock = VideoClock(unix_s(FixServer.start_utc), live=False)
        self.lost = 0

    def until(self, t_s: float) -> tuple[list[vgps.Fix], list[str]]:
        """Return the fixes and notes that have arrived by then."""
        alive = not self._down[0] <= t_s < self._down[1]
        if alive != self._alive:
            (self._server.start if alive else self._server.stop)()
            self._alive = alive
        while self._source.fix(self._second).t_s + self._late_s <= t_s:
            fix = self._source.fix(self._second)
            valid = not self._outage[0] <= fix.t_s < self._outage[1]
            self.lost += valid and not self._server.connected
            self._server.send(fix, valid)
            time.sleep(0.06)  # real time: an epoch ends when nothing more comes
            self._second += 1
        received, notes = self._gps.poll()
        return [self._clock.fix(fix)[0] for fix in received], notes

    def close(self) -> None:
        """Close both ends."""
        self._gps.close()
        self._server.stop()


@dataclass(frozen=True)
class DriveResult:
    """Measures by frame, what happened, the fixes' own mean error, and how many the stopped server lost."""

    measures: FrameMeasures
    events: list[str]
    fix_error_m: float
    lost_fixes: int


def drive(given: argparse.Namespace) -> DriveResult:
    """Feed the smoother frame by frame, and measure."""
    recording = vgps.open_recording(given.recording, gps=given.gps)
    source = PingPong(recording, given.section)
    smoother = vgps.OnlineSmoother(recording.camera, recording.rig)
    measures, events, end_s = FrameMeasures(), list[str](), given.frames * source.interval_s
    outage, down = (0.5 * end_s, 0.5 * end_s + given.outage), (0.75 * end_s, 0.75 * end_s + given.down)
    receiver = Receiver(source, given.late, outage, down)
    clock = time.process_time if given.cpu else time.perf_counter
    start = time.perf_counter()
    for index in range(given.frames):
        t_s, image, true = source.frame(index)
        if given.pace:
            time.sleep(max(0.0, start + index / given.pace - time.perf_counter()))
        fixes, notes = receiver.until(t_s)
        for note in notes:
            smoother.add_note(note)
        begun = clock()
        for fix in fixes:
            smoother.add_fix(fix)
        estimate = smoother.add_frame(t_s, image)
        posed = clock()
        smoother.refine()
        measures.add(t_s, estimate, true, posed - begun, clock() - posed)
        events += [f"{event.t_s:8.1f} s  {event.kind}: {event.text}" for event in estimate.events]
    receiver.close()
    return DriveResult(measures, events, source.fix_error_m, receiver.lost)


def plot(found: FrameMeasures, given: argparse.Namespace, path: Path) -> None:
    """Draw errors, latency and memory over time."""
    figure = Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    pose_ms, refine_ms = 1e3 * np.array(found.pose_s), 1e3 * np.array(found.refine_s)
    axes[0].fill_between(found.t_s, 2 * np.array(found.sigma_m), color="0.88", label="two sigma")
    axes[0].plot(found.t_s, found.error_m, label="corrected", lw=1)
    axes[0].plot(found.t_s, found.smooth_error_m, label="smooth", lw=1)
    axes[0].set(ylabel="error as it came [m]", ylim=(0, 1.2 * np.nanmax(found.smooth_error_m)))
    axes[1].plot(found.t_s, pose_ms, ".", ms=2, label="until the pose is known")
    axes[1].plot(found.t_s, refine_ms, ".", ms=2, label="stage C after it")
    axes[1].set(ylabel="ms", yscale="log", ylim=(0.9, None))
    axes[2].plot(found.t_s, found.memory_mb, color="0.3", lw=1)
    axes[2].set(ylabel="memory [MB]", xlabel="s", ylim=(0, None))
    end_s = found.t_s[-1]
    for axis in axes:
        axis.axvspan(0.5 * end_s, 0.5 * end_s + given.outage, color="C3", alpha=0.12, label="no fixes")
        axis.axvspan(0.75 * end_s, 0.75 * end_s + given.down, color="C4", alpha=0.15, label="server down")
        axis.margins(x=0)
    axes[0].legend(ncols=5, fontsize=8, loc="upper left")
    axes[1].legend(ncols=4, fontsize=8, loc="upper left")
    figure.savefig(path, dpi=110)


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("recording", type=Path, help="with truth")
    parser.add_argument("--gps", default="gps_float.nmea", help="a path, or a name inside the recording")
    parser.add_argument("--frames", type=int, default=10000, help="length of the drive")
    parser.add_argument("--section", type=int, default=400, help="frames that are played to and fro")
    parser.add_argument("--outage", type=float, default=30.0, help="seconds without fixes, in the middle")
    parser.add_argument("--late", type=float, default=0.4, help="delay of a fix, seconds")
    parser.add_argument("--down", type=float, default=10.0, help="seconds without the receiver's server")
    parser.add_argument("--cpu", action="store_true", help="measure processor time of all threads together")
    parser.add_argument("--pace", type=float, help="frames per second; without it as fast as they go")
    parser.add_argument("--events", action="store_true", help="print all events but the fixes that were used")
    parser.add_argument("--plot", type=Path, metavar="PNG", help="draw errors, latency and memory")
    return parser.parse_args()


def main() -> None:
    """Print a row for the first frames, the last ones, and all."""
    parser = ScriptParser("benchmarks.online", __doc__)
    given = arguments(parser)
    with parser.refusals():
        results = parser.results(given)
        found = drive(given)
    measures, part = found.measures, min(1000, given.frames // 3)
    last = slice(len(measures.t_s) - part, None)
    parts = {f"first {part}": slice(0, part), f"last {part}": last, "all": slice(None)}
    rows = {name: measures.row(rows) for name, rows in parts.items()}
    for name, figures in rows.items():
        results.add(frames=name, **figures)
    growth = measures.growth(part)
    results.summarise(fix_error_m=found.fix_error_m, lost_fixes=found.lost_fixes, **growth)
    print(
        table(
            ["frames", *COLUMNS.values()],
            ([name, *(f"{x:.3g}" for x in figures.values())] for name, figures in rows.items()),
        )
    )
    print(
        f"\nMean error of the fixes: {found.fix_error_m:.2f} m. From the first to the last {part} frames: "
        f"pose p50 x {growth['median_pose_ratio']:.2f}, memory {growth['memory_growth_mb']:+.1f} MB. "
        f"{found.lost_fixes} fixes were lost while the server was down or not yet found again."
    )
    if given.events:
        print("\n".join(line for line in found.events if not line.endswith(" used")))
    if given.plot:
        plot(measures, given, given.plot)


if __name__ == "__main__":
    main()
