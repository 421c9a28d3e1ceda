from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fewer_features import fewer_features

import vgps
from vgps.camera_calibration.lens import angles, parameters_of
from vgps.evaluation import evaluate
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, GpsConfig, simulate

WIDTH, HEIGHT = 240, 160
CORNER_PX = float(np.hypot(WIDTH, HEIGHT)) / 2


def filmed(folder: Path, degrees: float) -> Path:
    """A walk with RTK-fixes through a fisheye with a rolling shutter."""
    scene = replace(
        SCENES["demo"],
        speed=((0.0, 1.2), (5.0, 1.2)),
        fps=4,
        width=WIDTH,
        height=HEIGHT,
        fisheye_deg=degrees,
        readout_s=0.03,
        texture_scale=0.5,
        gps=GpsConfig(fix_share=0.5, interval_s=0.5),
    )
    simulate(folder, scene)
    return folder


def mean_error_m(solution: vgps.Solution, folder: Path) -> float:
    return evaluate(solution, read_trajectory(folder / "truth.tum")).camera_position_m.mean


@pytest.mark.slow
def test_a_wide_lens_that_nobody_calibrated_is_as_good_as_a_narrow_one(tmp_path: Path) -> None:
    """With 80 degrees and its calibration the walk has a mean error of 0.025 m: 1.3 times as much will do."""
    wide = filmed(tmp_path / "150", 150.0)
    (wide / "camera.yaml").unlink()
    found = vgps.smooth(vgps.open_recording(wide), fewer_features(150, camera_calibration={"max_pairs": 12}))
    assert found.camera.model == "fisheye"
    half, corner = np.degrees(
        angles("fisheye", parameters_of(found.camera), np.array([0.5, 1.0]) * CORNER_PX)
    )
    assert half == pytest.approx(37.5, rel=0.03) and corner == pytest.approx(75.0, rel=0.03)
    assert mean_error_m(found, wide) < 0.033
