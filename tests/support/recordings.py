"""Small simulated recordings, made once for all tests that smooth."""

from dataclasses import replace
from pathlib import Path

from vgps.simulate import SCENES, GpsConfig, SceneConfig, simulate

SMALL: SceneConfig = replace(
    SCENES["demo"],
    width=320,
    height=240,
    focal_px=260.0,
    speed=((0.0, 1.5), (6.0, 1.5)),
    bends=((2.0, 3.0, 50.0),),
    gps=GpsConfig(fix_share=0.5),
    texture_scale=0.5,
)
BRIEF: SceneConfig = replace(
    SMALL,
    speed=((0.0, 1.5), (3.0, 1.5)),
    bends=((1.0, 2.0, 50.0),),
    gps=GpsConfig(fix_share=0.5, interval_s=0.5),
)
SHAKEN: SceneConfig = replace(SMALL, fps=30, hand_shake=1.0, readout_s=0.03, speed=((0.0, 1.5), (2.2, 1.5)))


def small_recording(folder: Path) -> Path:
    """Six seconds of walking round a corner, every fix RTK-fix."""
    simulate(folder, SMALL, seed=3)
    return folder


def brief_recording(folder: Path) -> Path:
    """Three seconds of it with a fix every half second, for tests of what is done with a run."""
    simulate(folder, BRIEF, seed=3)
    return folder


def shaken_recording(folder: Path) -> Path:
    """Two seconds through the rolling shutter of a camera in an unsteady hand."""
    simulate(folder, SHAKEN, seed=3)
    return folder
