"""The verb ``simulate``."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

from vgps.cli.app import print_line
from vgps.cli.options import NotNegative, Seed

if TYPE_CHECKING:
    from vgps.simulate import SceneConfig


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Shutter:
    """What changes the pictures of a scene.

    Attributes:
        fps: Frames per second instead of the scene's.
        readout_s: Time from the first row to the last of a rolling shutter, seconds; the frame's time stamp
            and true pose are those of the middle row.
        hand_shake: Shaking of the hand that holds the camera; 1 is as measured with a GoPro's gyro.
        fisheye_deg: Diagonal field of view of an equidistant fisheye, which takes the place of the scene's
            pinhole.
        panorama_deg: 360 for an equirectangular picture of the whole sphere, twice as wide as high; or the
            angle that a circular fisheye sees across the shorter side, from 170.
        width: Width of the picture in pixels, instead of the scene's.
        height: Its height.
    """

    fps: Annotated[int, Parameter(validator=Number(gte=1, lte=240))] | None = None
    readout_s: NotNegative | None = None
    hand_shake: NotNegative | None = None
    fisheye_deg: NotNegative | None = None
    panorama_deg: NotNegative | None = None
    width: Annotated[int, Parameter(validator=Number(gte=64, lte=8192))] | None = None
    height: Annotated[int, Parameter(validator=Number(gte=64, lte=8192))] | None = None

    def changes(self) -> dict[str, Any]:
        """Return the fields of the scene that are given."""
        return {name: value for name, value in asdict(self).items() if value is not None}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class GivenPath:
    """A path for the camera instead of the scene's own.

    Attributes:
        path: Poses as KITTI odometry writes them, twelve numbers a line; they are levelled, since the ground
            is flat. Streets that the path comes back to look as they did.
        path_hz: Poses per second.
        first_pose: First pose to use, counted from 0. The streets are those of the whole path, so that
            recordings of different parts show one world.
        poses: Number of poses to use; by default all that follow.
        look_alike_m: Distance after which the surroundings repeat, so that different streets look alike.
    """

    path: Path | None = None
    path_hz: Annotated[float, Parameter(validator=Number(gte=1, lte=240))] = 10.0
    first_pose: Annotated[int, Parameter(validator=Number(gte=0))] = 0
    poses: Annotated[int, Parameter(validator=Number(gte=1))] | None = None
    look_alike_m: NotNegative = 0.0

    def applied(self, scene: "SceneConfig") -> "SceneConfig":
        """Return the scene on this path, if one is given."""
        from vgps.simulate.camera_path import read_camera_path
        from vgps.simulate.scene import on_path

        scene = replace(scene, look_alike_m=self.look_alike_m)
        if self.path is None:
            return scene
        return on_path(scene, read_camera_path(self.path, self.path_hz, self.first_pose, self.poses))


def simulate(
    *,
    out: Path,
    scene: str | None = None,
    seed: Seed = 0,
    gps_errors: Path | None = None,
    gps_reference: Path | None = None,
    gps_seed: Seed | None = None,
    pass_seed: Seed | None = None,
    imu: bool = False,
    cameras: Annotated[int, Parameter(validator=Number(gte=1, lte=6))] = 1,
    shutter: Shutter | None = None,
    given: GivenPath | None = None,
) -> None:
    """Simulate a recording with exact truth: video, GPS, gyro and calibration.

    Args:
        out: Recording folder to write.
        scene: walk (70 m, hand-held, as in the thesis), drive, demo, spin, drone or orbit; by default walk,
            or drive with a path, of which it is then the camera.
        seed: Seed of the world, of the shaking, and of the sensors' errors.
        pass_seed: Seed of all but the world, if not the same: another pass of its street.
        gps_errors: Log of a receiver that stood still; its errors replace the simulated ones.
        gps_reference: Better log of the same antenna if that receiver moved; its RTK-fix epochs are
            the truth.
        gps_seed: Seed of the receiver's errors, if not that of the world.
        imu: Also write imu.csv, the gyro and an accelerometer, and their mounting.
        cameras: Number of cameras of the rig, at equal angles around it.
        shutter: Frame rate, readout and shaking.
        given: Path and surroundings.
    """
    from vgps.simulate import AccelerometerConfig, scene_with_errors
    from vgps.simulate import simulate as simulate_recording

    given = given or GivenPath()
    name = scene or ("walk" if given.path is None else "drive")
    config = given.applied(scene_with_errors(name, gps_errors, gps_reference))
    config = replace(config, **(shutter or Shutter()).changes(), cameras=cameras, pass_seed=pass_seed)
    config = replace(config, gps=replace(config.gps, seed=gps_seed))
    if imu:
        config = replace(config, accelerometer=AccelerometerConfig())
    simulate_recording(out, config, seed)
    print_line(f"wrote {out}")
