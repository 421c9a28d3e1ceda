"""Does the live mode stay up and flat in memory under hours of faults?

A simulated walk is shown forwards and backwards to ``OnlineSmoother`` as fast as it can take it, in simulated
time. Its receiver sends NMEA that babbles (random bytes), stalls, repeats itself, jumps in time by hours and
days, and at times sends 100 messages of garbage a second; its camera freezes, goes dark and drops 90 % of its
frames. Every fault lasts half a minute, with a good half minute before it. The exit code is 1 if no fix was
read, or if the memory at the end is more than 50 MB above that after the first quarter.
"""

import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path

import numpy as np
from pynmeagps import calc_checksum

from scripts.common.command import ScriptParser
from scripts.common.memory import resident_mb
from scripts.common.scenes import small_walk
from vgps.config import Config
from vgps.geodesy import to_geodetic
from vgps.model import GeodeticPoint, GrayImage
from vgps.online import OnlineSmoother
from vgps.online.gps_messages import Epochs, messages
from vgps.readers.fixes import unix_s
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import simulate

_RATE_HZ = 5.0
_SPELL_S = 30.0
_BEGIN = datetime(2026, 5, 1, 9, 30, tzinfo=UTC)
_RECEIVER = ("babble", "stall", "repeat", "jump", "garbage")
_CAMERA = ("freeze", "dark", "drop")


@dataclass
class Receiver:
    """Faulty NMEA of true positions; ``sent`` counts the fixes by fault."""

    origin: GeodeticPoint
    rng: random.Random
    sent: Counter[str] = field(default_factory=Counter)

    def second(self, t_s: float, antenna: np.ndarray, fault: str) -> bytes:
        """Return what the receiver sends in a second."""
        if fault == "stall":
            return b""
        hours = self.rng.choice((-48, -3, 3, 72)) if fault == "jump" else 0
        sentences = self._fix(t_s + 3600.0 * hours, antenna)
        copies = 5 if fault == "repeat" else 1
        self.sent[fault] += copies
        if fault == "babble":
            return self.rng.randbytes(300).replace(b"$", b"") + b"\n" + sentences + self.rng.randbytes(50)
        noise = b"".join(b"$GPGGA,," + self.rng.randbytes(20) + b"\n" for _ in range(100))
        return (noise if fault == "garbage" else b"") + sentences * copies

    def _fix(self, t_s: float, antenna: np.ndarray) -> bytes:
        at, place = _BEGIN + timedelta(seconds=t_s), to_geodetic(self.origin, antenna)
        latitude, longitude, height = (float(number) for number in place)
        fields = (
            f"{_degrees(latitude, 2)},N,{_degrees(longitude, 3)},E,4,12,0.8,{height:.3f},M,0.0,M,1.0,0000"
        )
        return _sentence(f"GPGGA,{at:%H%M%S}.00,{fields}") + _sentence(
            f"GPZDA,{at:%H%M%S}.00,{at:%d,%m,%Y},00,00"
        )


def _degrees(value: float, width: int) -> str:
    return f"{int(value):0{width}d}{60 * (value % 1):010.7f}"


def _sentence(body: str) -> bytes:
    return f"${body}*{calc_checksum(body)}\r\n".encode()


def _fault(t_s: float) -> tuple[str, str]:
    """Return the faults of receiver and camera at a time; every other spell is good."""
    spell = int(t_s / _SPELL_S)
    if spell % 2 == 0:
        return "", ""
    return _RECEIVER[spell // 2 % len(_RECEIVER)], ("", *_CAMERA)[spell // 2 % 4]


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
        true = last - abs(index % (2 * last) - last)
        yield t_s, true, None if fault == "drop" and rng.random() < 0.9 else image


def main() -> None:
    """Print a line per ten minutes of simulated time; exit with code 1 if something is wrong."""
    parser = ScriptParser("experiments.live_faults", __doc__)
    parser.add_argument("--hours", type=float, default=6.0, help="simulated hours")
    given = parser.parse_args()
    results, rng = parser.results(given), random.Random(0)
    with tempfile.TemporaryDirectory() as scratch:
        small = small_walk(1.0)
        simulate(Path(scratch) / "walk", small, seed=3)
        opened = open_recording(Path(scratch) / "walk")
        true = read_trajectory(Path(scratch) / "walk/truth.tum").world_T_camera
        images = [frame.gray for frame in opened.video.frames()]
    origin = opened.rig.world_origin
    assert origin is not None
    smoother, receiver, epochs = (
        OnlineSmoother(opened.camera, opened.rig, Config()),
        Receiver(origin, rng),
        Epochs(),
    )
    counts: Counter[str] = Counter()
    memory_mb: list[float] = []
    for t_s, row, image in _frames(images, given.hours, rng):
        if t_s % 1.0 == 0.0:
            antenna = true[row, :3, 3] + true[row, :3, :3] @ opened.rig.camera_p_antenna
            for raw in messages(BytesIO(receiver.second(t_s, antenna, _fault(t_s)[0]))):
                for streamed in epochs.add(raw):
                    fix = streamed.fix._replace(t_s=streamed.fix.t_s - unix_s(_BEGIN))
                    counts["fixes accepted" if smoother.add_fix(fix) else "fixes refused"] += 1
        if image is None:
            counts["frames dropped"] += 1
            continue
        estimate = smoother.add_frame(t_s, image)
        smoother.refine()
        counts[f"frames {estimate.state}"] += 1
        counts.update(f"events {event.kind}" for event in estimate.events)
        if t_s and t_s % 600 == 0:
            memory_mb.append(resident_mb())
            results.add(
                t_s=t_s, memory_mb=memory_mb[-1], **{key.replace(" ", "_"): n for key, n in counts.items()}
            )
            print(f"{t_s / 3600:.2f} h: {memory_mb[-1]:.0f} MB, {dict(counts)}", flush=True)
    read = counts["fixes accepted"] + counts["fixes refused"]
    results.summarise(fixes_sent=sum(receiver.sent.values()), fixes_read=read)
    print(f"fixes sent {dict(receiver.sent)}, read {read}")
    grown = memory_mb[-1] - memory_mb[len(memory_mb) // 4] if len(memory_mb) > 4 else 0.0
    sys.exit(1 if grown > 50.0 or not read else 0)


if __name__ == "__main__":
    main()
