"""How much less does a video drift with another camera on the rig, and does that one bridge its dark?

For each recording of a rig with truth, without GPS: the error after a similarity of the first camera alone
and of all cameras, and of both with a picture of the first camera that is black for a while.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from vgps.cli.terminal import TerminalProgress
from vgps.evaluation import evaluate
from vgps.model import Frame, Recording
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.offline import optimise_all
from vgps.readers.trajectory import read_trajectory
from vgps.readers.video.derived_video import DerivedVideo
from vgps.solution import FrameState, Trajectory

COLUMNS = ["recording", "cameras", "black [s]", "mean [m]", "max [m]", "frames without a camera"]


@dataclass(frozen=True)
class Darkened(DerivedVideo):
    """A video that is black for a while."""

    begin_s: float
    end_s: float

    def frames(self) -> Iterator[Frame]:
        """Yield the frames, black from begin to end."""
        for frame in self.video.frames():
            dark = self.begin_s <= frame.t_s < self.end_s
            yield replace(frame, gray=np.zeros_like(frame.gray)) if dark else frame


def without_others(front_end: FrontEnd) -> FrontEnd:
    """Return the result of the first camera alone."""
    return replace(front_end, recording=replace(front_end.recording, cameras=()), others=())


def runs(
    recording: Recording, dark_s: tuple[float, float], config: vgps.Config
) -> Iterator[tuple[float, FrontEnd]]:
    """Yield for how long the first camera is black, and the result of stages A to C."""
    progress = TerminalProgress()
    both = run_front_end(recording, config, progress)
    yield 0.0, without_others(both)
    yield 0.0, both
    dark = replace(recording, video=Darkened(recording.video, *dark_s), cameras=())
    alone = run_front_end(dark, config, progress)
    length_s = dark_s[1] - dark_s[0]
    yield length_s, alone
    yield length_s, replace(alone, recording=replace(dark, cameras=recording.cameras), others=both.others)


def figures(front_end: FrontEnd, truth: Trajectory, config: vgps.Config) -> dict[str, float | int]:
    """Return errors of the result of stage D [m], and the number of frames that no camera tracked."""
    solution = optimise_all(front_end, config, TerminalProgress())
    error = evaluate(solution, truth).camera_position_after_sim3_m
    assert error is not None  # a path
    return {"mean_m": error.mean, "max_m": error.max, "bridged": solution.state.count(FrameState.BRIDGED)}


def main() -> None:
    """Print a row per run as it comes."""
    parser = ScriptParser("benchmarks.rigs", __doc__)
    parser.add_argument("recordings", type=Path, nargs="+", help="with truth.tum")
    parser.add_argument(
        "--dark-s", type=float, nargs=2, default=[8.0, 68.0], help="from when to when the first is black"
    )
    given = parser.parse_args()
    config = vgps.Config.model_validate({"gps": {"model": "none"}})
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for path in given.recordings:
            recording, truth = vgps.open_recording(path, with_gps=False), read_trajectory(path / "truth.tum")
            for dark_s, front_end in runs(recording, tuple(given.dark_s), config):
                row = {"recording": path.name, "cameras": 1 + len(front_end.others), "dark_s": dark_s}
                found = figures(front_end, truth, config)
                results.add(**row, **found)
                errors = (f"{found[key]:.4f}" for key in ("mean_m", "max_m"))
                table.add(*map(str, row.values()), *errors, found["bridged"])


if __name__ == "__main__":
    main()
