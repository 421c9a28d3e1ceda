"""The verb ``simulate``."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

from vgps.cli.app import print_line
from vgps.cli.options import NotNegative, Seed


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Shutter:
    """What changes the pictures of a scene.

    Attributes:
        fps: Frames per second instead of the scene's.
        readout_s: Time from the first row to the last of a rolling shutter, seconds; the frame's time stamp
            and true pose are those of the middle row.
        hand_shake: Shaking of the hand that holds the camera; 1 is as measured with a GoPro's gyro.
    """

    fps: Annotated[int, Parameter(validator=Number(gte=1, lte=240))] | None = None
    readout_s: NotNegative | None = None
    hand_shake: NotNegative | None = None

    def changes(self) -> dict[str, Any]:
        """Return the fields of the scene that are given."""
        return {name: value for name, value in asdict(self).items() if value is not None}


def simulate(
    *,
    out: Path,
    scene: str = "walk",
    seed: Seed = 0,
    gps_errors: Path | None = None,
    gps_reference: Path | None = None,
    imu: bool = False,
    shutter: Shutter | None = None,
) -> None:
    """Simulate a recording with exact truth: video, GPS, gyro and calibration.

    Args:
        out: Recording folder to write.
        scene: walk (70 m, hand-held, as in the thesis), drive, demo or spin.
        seed: Seed of the world and of the sensors' errors.
        gps_errors: Log of a receiver that stood still; its errors replace the simulated ones.
        gps_reference: Better log of the same antenna if that receiver moved; its RTK-fix epochs are
            the truth.
        imu: Also write imu.csv, the gyro and an accelerometer, and their mounting.
        shutter: Frame rate, readout and shaking.
    """
    from vgps.simulate import AccelerometerConfig, scene_with_errors
    from vgps.simulate import simulate as simulate_recording

    config = replace(scene_with_errors(scene, gps_errors, gps_reference), **(shutter or Shutter()).changes())
    if imu:
        config = replace(config, accelerometer=AccelerometerConfig())
    simulate_recording(out, config, seed)
    print_line(f"wrote {out}")
