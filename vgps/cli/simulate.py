"""The verb ``simulate``."""

from pathlib import Path

from vgps.cli.app import print_line
from vgps.cli.options import Seed


def simulate(
    *,
    out: Path,
    scene: str = "walk",
    seed: Seed = 0,
    gps_errors: Path | None = None,
    gps_reference: Path | None = None,
) -> None:
    """Simulate a recording with exact truth: video, GPS, gyro and calibration.

    Args:
        out: Recording folder to write.
        scene: walk (70 m, hand-held, as in the thesis), drive, demo or spin.
        seed: Seed of the world and of the sensors' errors.
        gps_errors: Log of a receiver that stood still; its errors replace the simulated ones.
        gps_reference: Better log of the same antenna if that receiver moved; its RTK-fix epochs are
            the truth.
    """
    from vgps.simulate import scene_with_errors
    from vgps.simulate import simulate as simulate_recording

    simulate_recording(out, scene_with_errors(scene, gps_errors, gps_reference), seed)
    print_line(f"wrote {out}")
