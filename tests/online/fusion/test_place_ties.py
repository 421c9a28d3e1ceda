from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ARM, DrivingCamera, fixed_then_float

from vgps.config import Config
from vgps.model import FixClass
from vgps.online.fusion.fusion_equations import cost, normal_equations
from vgps.online.fusion.path_fusion import fuse
from vgps.online.fusion.place_ties import PlaceTies

DRIVE = DrivingCamera(300)
SIGMA = np.array([0.05, 0.05, 0.05, 0.002, 0.002, 0.002])


def tied(frames, wrong_m=0.0):
    """Ties of frames to their true poses, all wrong by so much to the east."""
    poses = DRIVE.true[frames].copy()
    poses[:, 0, 3] += wrong_m
    return PlaceTies(t_s=DRIVE.t_s[frames], world_T_camera=poses, sigma=np.tile(SIGMA, (len(frames), 1)))


def fits(ties, fixed_again=0):
    """Fits until the end of a drive whose RTK-fixes turn into RTK-floats 3 m off, tied or not."""
    kinds, wrong = fixed_then_float(4, 26 - fixed_again, [1.5, -1.0, 2.0], fixed_again)
    path, fixes = DRIVE.seen(np.random.default_rng(5), share=0.3), DRIVE.fixes(kinds, wrong)
    before = fuse(path, fixes, ARM, Config(), None)
    path = replace(path, ties=ties)
    return path, before, fuse(path, fixes, ARM, Config(), before)


def error_m(fit, path):
    return np.linalg.norm(fit.world_T_camera(path)[-1, :3, 3] - DRIVE.true[-1, :3, 3])


def test_a_place_seen_again_corrects_the_newest_pose_and_its_sigmas():
    path, before, after = fits(tied([290]))
    assert error_m(after, path) < 0.15
    assert error_m(before, path) > 0.25
    sigma_m, sigma_before_m = (np.sqrt(np.trace(one.covariance[:3, :3])) for one in (after, before))
    assert sigma_m < 0.3 < sigma_before_m
    # and what is rotated with it
    turn = after.state.world_R_map[-1] @ path.poses[-1, :3, :3] @ DRIVE.true[-1, :3, :3].T
    assert np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)) < 0.005


def test_the_gradient_of_places_is_that_of_their_cost():
    _, _, fit = fits(tied([100, 290], wrong_m=0.2))
    rng = np.random.default_rng(0)
    state = fit.state.moved(1e-2 * rng.standard_normal(fit.state.values.shape))
    none = replace(fit.nodes, ties=PlaceTies.none(), tied=np.zeros(0, dtype=np.int64))
    assert len(fit.nodes.tied) == 2
    gradient, without = (normal_equations(nodes, state, fit.prior).gradient for nodes in (fit.nodes, none))
    for node in fit.nodes.tied.tolist():
        for unknown in (0, 1, 2, 4, 5, 6):
            delta = np.zeros_like(gradient)
            delta[node, unknown] = 1e-6
            ends = [
                cost(fit.nodes, moved, fit.prior) - cost(none, moved, fit.prior)
                for moved in (state.moved(-delta), state.moved(delta))
            ]
            expected = (ends[1] - ends[0]) / 2e-6
            assert (gradient - without)[node, unknown] == pytest.approx(expected, rel=0.05, abs=1.0)


def test_a_wrong_place_gives_way_to_fixes_that_contradict_it():
    path, _, after = fits(tied([200], wrong_m=3.0), fixed_again=6)
    assert error_m(after, path) < 0.1
    assert abs(after.world_T_camera(path)[200, 0, 3] - DRIVE.true[200, 0, 3]) < 0.5


def test_a_place_stays_known_after_its_frame_has_left_the_path():
    kinds = [FixClass.RTK_FLOAT] * 30
    path = replace(DRIVE.seen(np.random.default_rng(6), share=0.1), ties=tied([60]))
    fixes = DRIVE.fixes(kinds, np.tile([1.5, -1.0, 2.0], (30, 1)))
    whole = fuse(path, fixes, ARM, Config(), None)
    rest = fuse(path.since(12.0), fixes, ARM, Config(), whole)
    assert len(rest.nodes.tied) == 0
    assert np.linalg.norm(rest.world_T_camera(path.since(12.0))[-1, :3, 3] - DRIVE.true[-1, :3, 3]) < 0.3
