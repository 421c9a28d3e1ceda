"""Does the live mode stay up and flat in memory under hours of faults?

A simulated walk is shown forwards and backwards to ``OnlineSmoother`` as fast as it can take it, in
simulated time. Its receiver sends NMEA that babbles (random bytes), stalls, repeats itself, jumps in time
by hours and days, and at times sends 100 messages of garbage a second; its camera freezes, goes dark, drops
90 % of its frames and changes their size. Every fault lasts half a minute, with a good half minute before
it. The exit code is 1 if a good half minute does not end with the camera tracked, if a fix is unaccounted
for (random bytes may swallow a sentence), or if the memory at the end is more than 50 MB above that after the
first quarter.
"""

import random
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path

import numpy as np

from scripts.common.command import ScriptParser
from scripts.common.fix_server import sentences
from scripts.common.memory import resident_mb
from scripts.common.scenes import half_size, small_walk
from vgps.config import Config
from vgps.errors import VideoError
from vgps.geodesy import to_geodetic
from vgps.model import FixClass, GeodeticPoint, GrayImage
from vgps.online import OnlineSmoother
from vgps.online.sources.gps_messages import Epochs, StreamedFix, messages
from vgps.readers.gps_formats.fixes import Fix, unix_s
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import simulate

_RATE_HZ = 5.0
_SPELL_S = 30.0
_BEGIN = datetime(2026, 5, 1, 9, 30, tzinfo=UTC)
_RECEIVER = ("babble", "stall", "repeat", "jump", "garbage")
_CAMERA = ("", "freeze", "dark", "drop", "size", "")  # six beside five: every pair in half an hour
_RANDOM = ("babble", "garbage")  # of the receiver: random bytes before a sentence
_MOST_GROWTH_MB = 50.0


@dataclass
class Receiver:
    """Faulty NMEA of true positions; ``sent`` counts the fixes by fault."""

    origin: GeodeticPoint
    rng: random.Random
    sent: Counter[str] = field(default_factory=Counter)
    _last: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=10))

    def second(self, t_s: float, antenna: np.ndarray, fault: str) -> bytes:
        """Return what the receiver sends in a second."""
        if fault == "stall":
            return b""
        at_s = t_s + 3600.0 * (self.rng.choice((-48, -3, 3, 72)) if fault == "jump" else 0)
        latitude, longitude, height = to_geodetic(self.origin, antenna).tolist()
        epoch = sentences(Fix(at_s, latitude, longitude, height, FixClass.RTK_FIX, 0), _BEGIN)
        copies = 5 if fault == "repeat" else 1
        self.sent[fault] += copies
        self._last.append((at_s, fault))
        if fault == "babble":
            return self.rng.randbytes(300).replace(b"$", b"") + b"\n" + epoch + self.rng.randbytes(50)
        noise = b"".join(b"$GPGGA,," + self.rng.randbytes(20) + b"\n" for _ in range(100))
        return (noise if fault == "garbage" else b"") + epoch * copies

    def fault_of(self, t_s: float) -> str:
        """Return the fault with which a fix of this time was sent lately."""
        return next((fault for sent_s, fault in self._last if abs(sent_s - t_s) < 0.5), "unknown")


def _fault(t_s: float) -> tuple[str, str]:
    """Return the faults of receiver and camera at a time; every other spell is good."""
    spell = int(t_s / _SPELL_S)
    if spell % 2 == 0:
        return "", ""
    return _RECEIVER[spell // 2 % len(_RECEIVER)], _CAMERA[spell // 2 % len(_CAMERA)]


def _frames(
    images: list[GrayImage], hours: float, rng: random.Random
) -> Iterator[tuple[float, int, GrayImage | None]]:
    """Yield times, places on the walk, and images, which the camera may not deliver."""
    last = len(images) - 1
    for index in range(int(3600 * hours * _RATE_HZ)):
        t_s, fault = index / _RATE_HZ, _fault(index / _RATE_HZ)[1]
        begun = index - int(t_s % _SPELL_S * _RATE_HZ) if fault == "freeze" else index
        row = last - abs(begun % (2 * last) - last)
        image = np.zeros_like(images[row]) if fault == "dark" else images[row]
        image = image[: len(image) // 2] if fault == "size" else image
        true = last - abs(index % (2 * last) - last)
        yield t_s, true, None if fault == "drop" and rng.random() < 0.9 else image


@dataclass
class Ledger:
    """What came of the fixes and frames, and the events that report it.

    Attributes:
        smoother: Under test.
        receiver: Sends the fixes.
        counts: By what happened.
        read: Fixes that were read, by the fault with which they were sent.
    """

    smoother: OnlineSmoother
    receiver: Receiver
    counts: Counter[str] = field(default_factory=Counter)
    read: Counter[str] = field(default_factory=Counter)
    _epochs: Epochs = field(default_factory=Epochs)

    def hear(self, data: bytes) -> None:
        """Take the bytes of the receiver."""
        for raw in messages(BytesIO(data)):
            self._take(self._epochs.add(raw))

    def hear_the_rest(self) -> None:
        """End the last epoch."""
        self._take(self._epochs.flush())

    def see(self, t_s: float, image: GrayImage | None) -> None:
        """Take a frame, if the camera delivered one."""
        if image is None:
            self.counts["frames dropped"] += 1
            return
        try:
            estimate = self.smoother.add_frame(t_s, image)
        except VideoError:
            self.counts["frames refused"] += 1
            return
        self.smoother.refine()
        self.counts[f"frames {estimate.state}"] += 1
        self.counts.update(f"events {event.kind}" for event in estimate.events)
        spell, rest_s = divmod(t_s, _SPELL_S)
        if spell % 2 == 0 and rest_s >= _SPELL_S - 1.0 / _RATE_HZ - 1e-6:
            self.counts[f"good spells that end {estimate.state}"] += 1

    def unaccounted(self) -> list[str]:
        """Return the fixes that were not read, and the good spells that did not end tracked.

        Random bytes that look like the beginning of a binary message may swallow the sentence after them; no
        other fix may be lost.
        """
        lost = {fault: n - self.read[fault] for fault, n in self.receiver.sent.items()}
        wrong = [
            f"{n} fixes of {fault or 'good spells'}"
            for fault, n in lost.items()
            if n and fault not in _RANDOM
        ]
        ended = {key: n for key, n in self.counts.items() if key.startswith("good spells")}
        return wrong + [f"{n} {key}" for key, n in sorted(ended.items()) if not key.endswith(" tracked")]

    def _take(self, found: list[StreamedFix]) -> None:
        for streamed in found:
            fix = streamed.fix._replace(t_s=streamed.fix.t_s - unix_s(_BEGIN))
            self.read[self.receiver.fault_of(fix.t_s)] += 1
            self.counts["fixes accepted" if self.smoother.add_fix(fix) else "fixes refused"] += 1


def main() -> None:
    """Print a line per ten minutes of simulated time; exit with code 1 if something is wrong."""
    parser = ScriptParser("experiments.live_faults", __doc__)
    parser.add_argument("--hours", type=float, default=6.0, help="simulated hours")
    given = parser.parse_args()
    results, rng = parser.results(given), random.Random(0)
    with tempfile.TemporaryDirectory() as scratch:
        simulate(Path(scratch) / "walk", half_size(small_walk(1.0)), seed=3)
        opened = open_recording(Path(scratch) / "walk")
        true = read_trajectory(Path(scratch) / "walk/truth.tum").world_T_camera
        images = [frame.gray for frame in opened.video.frames()]
    assert opened.rig.world_origin is not None
    receiver = Receiver(opened.rig.world_origin, rng)
    ledger = Ledger(OnlineSmoother(opened.camera, opened.rig, Config()), receiver)
    memory_mb: list[float] = []
    for shown, (t_s, row, image) in enumerate(_frames(images, given.hours, rng), start=1):
        if t_s % 1.0 == 0.0:
            antenna = true[row, :3, 3] + true[row, :3, :3] @ opened.rig.camera_p_antenna
            ledger.hear(receiver.second(t_s, antenna, _fault(t_s)[0]))
        ledger.see(t_s, image)
        if shown % int(600 * _RATE_HZ) == 0:
            memory_mb.append(resident_mb())
            counted = {key.replace(" ", "_"): n for key, n in sorted(ledger.counts.items())}
            results.add(t_s=shown / _RATE_HZ, memory_mb=memory_mb[-1], cpu_s=time.process_time(), **counted)
            print(
                f"{shown / _RATE_HZ / 3600:.2f} h: {memory_mb[-1]:.0f} MB, {dict(ledger.counts)}", flush=True
            )
    ledger.hear_the_rest()
    wrong = ledger.unaccounted()
    sent, read = sum(receiver.sent.values()), sum(ledger.read.values())
    results.summarise(fixes_sent=sent, fixes_read=read, unaccounted=wrong)
    print(f"fixes sent {dict(receiver.sent)}, read {dict(ledger.read)}; unaccounted: {wrong or 'nothing'}")
    grown = memory_mb[-1] - memory_mb[len(memory_mb) // 4] if len(memory_mb) > 4 else 0.0
    sys.exit(1 if grown > _MOST_GROWTH_MB or wrong or not read else 0)


if __name__ == "__main__":
    main()
