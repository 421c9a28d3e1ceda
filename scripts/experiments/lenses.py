"""How well is a lens found from its video alone, and how much larger is the error than with the calibration?

A simulated walk is filmed through several lenses, narrow to fisheye, as a wide pinhole picture that is bent
into each. Nothing is known of the camera; the fixes are RTK-fix. Ray angles are those half way to the corners
and in them; the errors are unaligned.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from vgps.camera_calibration.lens import angles, parameters_of
from vgps.evaluation import evaluate
from vgps.model import Camera, Float32Array, Frame, Recording
from vgps.readers.calibration.camera_guess import guess_cameras
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.video.derived_video import DerivedVideo
from vgps.simulate import SCENES, GpsConfig, simulate

WIDTH, HEIGHT = 480, 320
CORNER_PX = float(np.hypot(WIDTH, HEIGHT)) / 2


def lens(model: Literal["opencv", "fisheye"], focal: float, *distortion: float) -> Camera:
    """Return a camera of that focal length in widths."""
    return Camera(
        model=model,
        width=WIDTH,
        height=HEIGHT,
        fx=focal * WIDTH,
        fy=focal * WIDTH,
        cx=(WIDTH - 1) / 2 + 3.0,
        cy=(HEIGHT - 1) / 2 - 2.0,
        distortion=(*distortion, 0.0, 0.0),
    )


LENSES = {
    "tele": lens("opencv", 1.5, 0.05, 0.0),
    "phone": lens("opencv", 0.8, 0.06, -0.08),
    "dashcam": lens("opencv", 0.55, -0.2, 0.03),
    "action": lens("fisheye", 0.5, 0.03, 0.0),
    "fisheye 150": lens("fisheye", CORNER_PX / np.radians(75.0) / WIDTH, 0.0, 0.0),
}


@dataclass(frozen=True)
class BentVideo(DerivedVideo):
    """The frames of a pinhole camera as another lens shows them."""

    pinhole: Camera
    camera: Camera

    @property
    def width(self) -> int:
        """Pixels."""
        return self.camera.width

    @property
    def height(self) -> int:
        """Pixels."""
        return self.camera.height

    def frames(self) -> Iterator[Frame]:
        """Yield the bent frames."""
        u, v = source_pixels(self.camera, self.pinhole)
        for frame in self.video.frames():
            yield replace(frame, gray=np.asarray(cv2.remap(frame.gray, u, v, cv2.INTER_AREA), np.uint8))


def source_pixels(camera: Camera, pinhole: Camera) -> tuple[Float32Array, Float32Array]:
    """Return where the pixels of a lens are in the picture of a pinhole camera, two (H, W)."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    x, y = u - camera.cx, v - camera.cy
    radius = np.maximum(np.hypot(x, y), 1e-9)
    angle = angles(camera.model, parameters_of(camera), radius.ravel()).reshape(radius.shape)
    stretch = np.tan(angle) / radius * pinhole.fx
    u_px, v_px = x * stretch + pinhole.cx, y * stretch + pinhole.cy
    return u_px.astype(np.float32), v_px.astype(np.float32)


def film(folder: Path, camera: Camera, seconds: float, seed: int) -> Recording:
    """Simulate a walk with a pinhole that sees all of a lens, and return it through the lens."""
    u, v = source_pixels(camera, replace(camera, model="opencv", cx=0.0, cy=0.0))
    reach = int(np.ceil(max(np.abs(u).max(), np.abs(v).max() * WIDTH / HEIGHT))) + 8
    scene = replace(
        SCENES["demo"],
        speed=((0.0, 1.2), (seconds, 1.2)),
        width=2 * reach,
        height=2 * int(reach * HEIGHT / WIDTH) + 16,
        focal_px=camera.fx,
        gps=GpsConfig(fix_share=0.5),
    )
    simulate(folder, scene, seed)
    opened = vgps.open_recording(folder)
    return replace(opened, video=BentVideo(opened.video, opened.camera, camera), camera=camera)


def row(name: str, seed: int, seconds: float) -> dict[str, float | str]:
    """Film, smooth with and without the calibration, and compare."""
    camera = LENSES[name]
    with tempfile.TemporaryDirectory() as scratch:
        known = film(Path(scratch) / "walk", camera, seconds, seed)
        truth = read_truth(Path(scratch) / "walk")
        guesses = guess_cameras(known.video, Telemetry(known.video.path))
        runs = [
            vgps.smooth(one) for one in (known, replace(known, camera=guesses[0].camera, guesses=guesses))
        ]
    radii = np.array([0.5, 1.0]) * CORNER_PX
    found = runs[1].camera
    true, seen = (angles(one.model, parameters_of(one), radii) for one in (camera, found))
    given_m, found_m = (evaluate(run, truth).camera_position_m.mean for run in runs)
    half, corner = (100.0 * (seen / true - 1.0)).tolist()
    sigma = runs[1].sensors.camera_sigma["focal"]
    return {
        "lens": name,
        "seed": seed,
        "model": found.model,
        "focal_percent": 100.0 * (found.fx / camera.fx - 1.0),
        "focal_sigma_percent": 100.0 * sigma,
        "half_percent": half,
        "corner_percent": corner,
        "given_m": given_m,
        "found_m": found_m,
    }


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    add_seeds(parser, 2)
    parser.add_argument("--lenses", nargs="+", choices=tuple(LENSES), default=tuple(LENSES), help="which")
    parser.add_argument("--seconds", type=float, default=13.0, help="length of a walk")
    return parser.parse_args()


def main() -> None:
    """Print a markdown table, a row per lens and seed."""
    parser = ScriptParser("experiments.lenses", __doc__)
    given = arguments(parser)
    table = LiveTable(
        "lens",
        "seed",
        "found as",
        "focal length off",
        "rays half way",
        "in the corner",
        "mean error with; without",
    )
    with parser.refusals():
        results = parser.results(given)
        for name in given.lenses:
            for seed in range(given.seeds):
                one = row(name, seed, given.seconds)
                results.add(**one)
                table.add(
                    name,
                    str(seed),
                    str(one["model"]),
                    f"{one['focal_percent']:+.2f} % (sigma {one['focal_sigma_percent']:.2f})",
                    f"{one['half_percent']:+.2f} %",
                    f"{one['corner_percent']:+.2f} %",
                    f"{one['given_m']:.3f} m; {one['found_m']:.3f} m",
                )


if __name__ == "__main__":
    main()
