"""Fits that begin turned by quarters."""

from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ANTENNA, INTERVAL_S, DrivingCamera, fit_input, fixed_then_float
from scipy.spatial.transform import Rotation

from vgps.config import Config
from vgps.geometry import rotation_vectors
from vgps.online.fusion import turned_camera
from vgps.online.fusion.fusion_fit import fit, fit_with_verdicts
from vgps.online.fusion.lever_arm import LeverArm

CONFIG = Config()
STRAIGHT, FRAMES = 40, 150  # frames of the straight with which the drive begins, and of all


def roll(degrees):
    return Rotation.from_euler("z", degrees, degrees=True).as_matrix()


def as_it_begins(turned_deg):
    """A drive whose map was placed as if its camera were upright, and the true poses."""
    drive = DrivingCamera(FRAMES, straight_s=INTERVAL_S * STRAIGHT)
    drive.true[:, :3, :3] = drive.true[:, :3, :3] @ roll(turned_deg)
    kinds, wrong = fixed_then_float(FRAMES // 10, 0, [0.0, 0.0, 0.0])
    arm = roll(turned_deg).T @ ANTENNA
    fixes = drive.fixes(kinds, wrong)
    antenna = drive.true[:, :3, 3] + drive.true[:, :3, :3] @ arm
    noise = np.random.default_rng(0).normal(0.0, 0.01, (len(fixes), 3))
    fixes = replace(fixes, world_p_fix=antenna[:: FRAMES // len(fixes)] + noise)
    path = drive.seen()
    back = np.eye(4)
    first = drive.true[0, :3, :3]
    back[:3, :3] = first @ roll(-turned_deg) @ first.T  # about the axis of view of the first frame
    poses = back @ path.poses
    poses[:, :3, 3] += (drive.true[0, :3, :3] - poses[0, :3, :3]) @ arm
    return replace(path, poses=poses), fixes, LeverArm.within(arm), drive.true


def driven(turned_deg):
    """The fits as a drive goes on, and the error of the last one's rotations, degrees."""
    path, fixes, arm, true = as_it_begins(turned_deg)
    last, results = None, []
    for frames in range(STRAIGHT, FRAMES, 10):
        given = replace(fit_input(path, frames, fixes, last), lever_arm=arm, watches_clock=True)
        result = fit(given, CONFIG)
        results.append(fit_with_verdicts(given, CONFIG) if result.surprising else result)
        last = results[-1].fused
    found = last.world_T_camera(path)[:FRAMES, :3, :3]
    error = np.degrees(np.linalg.norm(rotation_vectors(found.transpose(0, 2, 1) @ true[:, :3, :3]), axis=1))
    return results, float(error[:frames].max())


@pytest.mark.parametrize("turned_deg, told", [(90.0, "a quarter"), (180.0, "half a"), (270.0, "a quarter")])
def test_fixes_of_a_turn_show_how_the_camera_is_turned(turned_deg, told):
    results, error_deg = driven(turned_deg)
    (turned,) = (one.turned for one in results if one.turned is not None)
    assert f"by {told} turn" in turned.note and error_deg < 3.0
    assert ("mirrored picture" in turned.note) == (turned_deg == 180.0)


def test_an_upright_camera_stays_upright():
    results, error_deg = driven(0.0)
    assert all(one.turned is None for one in results) and error_deg < 3.0


def test_a_turn_that_does_not_explain_the_fixes_well_is_none(monkeypatch):
    """As if these were expected to err by less than nothing."""
    monkeypatch.setattr(turned_camera, "_USUAL_COST", -10.0)
    results, error_deg = driven(180.0)
    assert all(one.turned is None for one in results) and error_deg > 90.0
