from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ANTENNA, ARM, SPEED_M_S, DrivingCamera, fixed_then_float
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import vgps
from vgps.geometry import rotation_matrices
from vgps.model import FixClass
from vgps.online.fusion.fusion_equations import MEAN_ROLL, OFFSET
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.path_fusion import fuse
from vgps.online.fusion.video_path import VideoPath

CONFIG = vgps.Config()


def cut(path, first, last):
    return VideoPath(t_s=path.t_s[first:last], poses=path.poses[first:last], moving=path.moving[first:last])


def live(drive, path, fixes, config=CONFIG, horizon=2000, every=10):
    """Fits after every so many frames, each from the one before, and errors (n, 3) of the newest position."""
    fits, errors = [], []
    for last in range(25, len(path.t_s) + 1, every):
        part = cut(path, max(0, last - horizon), last)
        fits.append(fuse(part, fixes, ARM, config, fits[-1] if fits else None))
        errors.append(fits[-1].world_T_camera(part)[-1, :3, 3] - drive.true[last - 1, :3, 3])
    return fits, np.array(errors)


@pytest.mark.slow
def test_the_pose_follows_the_video_when_float_follows_fix():
    drive, offset = DrivingCamera(400), np.array([1.5, -2.0, 4.0])
    fixes = drive.fixes(*fixed_then_float(20, 20, offset))
    (*_, last), errors = live(drive, drive.seen(np.random.default_rng(1), share=0.1), fixes)
    assert np.linalg.norm(errors[-1]) < 0.3 * np.linalg.norm(offset)
    np.testing.assert_allclose(last.state.values[-1, OFFSET], offset, atol=1.5)
    # what the receiver hides shows in the sigmas
    sigma = np.sqrt(np.diag(last.covariance_at_end(drive.seen(), CONFIG)))[:3]
    assert np.linalg.norm(errors[-1]) < 3.0 * np.linalg.norm(sigma)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("late", [0, 8])
def test_a_jump_of_a_float_solution_does_not_move_the_pose(late, seed):
    """As on kitti03, whose float solution jumps by 2.3 m in height: the next fit took that back."""
    drive = DrivingCamera(300)
    kinds, wrong = fixed_then_float(20, 10, [1.0, -1.0, 2.0])
    wrong[28:] += [0.0, 0.0, 2.5]
    path, fixes = drive.seen(np.random.default_rng(seed), share=0.1), drive.fixes(kinds, wrong)
    path = cut(path, 0, 281 + late)
    last = fuse(cut(path, 0, 276 + late), fixes.where(fixes.t_s < 28.0), ARM, CONFIG, None)
    now = fuse(path, fixes.where(fixes.t_s <= 28.0), ARM, CONFIG, last)
    assert np.linalg.norm(now.moved_from(last, path)) < 0.3
    np.testing.assert_allclose(
        now.state.values[-1, OFFSET] - last.state.values[-1, OFFSET], [0.0, 0.0, 2.5], atol=0.3
    )


@pytest.mark.slow
def test_returned_fixes_correct_the_pose_at_once():
    drive = DrivingCamera(400)
    fixes = drive.fixes(*fixed_then_float(10, 25, [2.0, 1.0, -5.0], fixed_again=5))
    _, errors = live(drive, drive.seen(np.random.default_rng(0)), fixes)
    size = np.linalg.norm(errors, axis=1)
    assert size[-4:].max() < 0.15 < size[10:30].mean()


@pytest.mark.slow
def test_the_time_offset_of_late_fixes_is_found_and_widens_the_sigmas_before():
    drive, late_s = DrivingCamera(600), 0.4
    fixes = drive.fixes([FixClass.RTK_FIX] * 60, np.zeros((60, 3)))
    stamped = replace(fixes, t_s=fixes.t_s + late_s)
    path = drive.seen(np.random.default_rng(2), share=0.5)
    fits, errors = live(drive, path, stamped)
    for fit, error_m, last in zip(fits, errors, range(25, 601, 10), strict=True):
        sigma_m = np.sqrt(np.diag(fit.covariance_at_end(cut(path, 0, last), CONFIG)))[:3]
        assert np.linalg.norm(error_m) < 3.0 * np.linalg.norm(sigma_m)
    assert fits[-1].time_offset.time_offset_s == pytest.approx(late_s, abs=0.03)
    assert np.linalg.norm(errors[0]) > 2.0 and np.linalg.norm(errors[-20:], axis=1).max() < 0.5
    assert fits[0].time_offset.sigma_s > 0.3 and fits[-1].time_offset.sigma_s < 0.1


@pytest.mark.parametrize("late_s", [0.3, -0.3])
def test_a_walkers_sway_tells_no_time_offset_at_first(late_s):
    walk = DrivingCamera(80)
    phase = np.pi * 1.7 * walk.t_s
    sway_m = [0.04 * np.sin(phase), walk.t_s, 0.03 * np.cos(2.0 * phase)]  # at 1 m/s
    walk.true[:, :3, 3] = np.stack(sway_m, axis=1)
    walk.true[:, :3, :3] = walk.true[0, :3, :3]
    fixes = walk.fixes([FixClass.RTK_FIX] * 8, np.zeros((8, 3)))
    fits, _ = live(walk, walk.seen(np.random.default_rng(3)), replace(fixes, t_s=fixes.t_s + late_s))
    found = [fit.time_offset for fit in fits]
    assert max(abs(one.time_offset_s - late_s) / one.sigma_s for one in found) < 2.0


@pytest.mark.slow
def test_the_bob_of_a_walk_in_a_circle_confirms_no_clock():
    """Any clock suits a circle at constant speed; only the bob of 1.8 Hz is left to compare at 1 Hz."""
    walk = DrivingCamera(300)
    angle, phase = 1.5 / 8.0 * walk.t_s, 2.0 * np.pi * 1.8 * walk.t_s
    circle = np.stack([8.0 * np.cos(angle), 8.0 * np.sin(angle), 0.025 * np.sin(phase)], axis=1)
    walk.true[:, :3, 3] = circle
    walk.true[:, :3, :3] = rotation_matrices(np.outer(angle, [0.0, 0.0, 1.0])) @ walk.true[0, :3, :3]
    noise_m = np.random.default_rng(5).normal(0.0, 0.008, (30, 3))
    fixes = walk.fixes([FixClass.RTK_FIX] * 30, noise_m)
    fits, _ = live(walk, walk.seen(np.random.default_rng(3)), replace(fixes, t_s=fixes.t_s - 0.3))
    found = [fit.time_offset for fit in fits]
    assert max(abs(one.time_offset_s + 0.3) / one.sigma_s for one in found) < 3.0


@pytest.mark.slow
def test_clocks_that_agree_are_left_alone():
    drive = DrivingCamera(600)
    fits, _ = live(
        drive, drive.seen(np.random.default_rng(2)), drive.fixes([FixClass.RTK_FIX] * 60, np.zeros((60, 3)))
    )
    assert abs(fits[-1].time_offset.time_offset_s) < 0.005 and fits[-1].time_offset.sigma_s < 0.03
    held = CONFIG.model_copy(
        update={"sensors": CONFIG.sensors.model_copy(update={"estimate_time_offset": "no"})}
    )
    fits, _ = live(drive, drive.seen(), drive.fixes([FixClass.RTK_FIX] * 60, np.zeros((60, 3))), held)
    assert fits[0].time_offset.sigma_s == fits[-1].time_offset.time_offset_s == 0.0


@pytest.mark.slow
def test_a_wrong_scale_and_heading_are_found_with_the_uncertainty_stated_before():
    drive, path = DrivingCamera(300), DrivingCamera(300).seen()
    turned = path.poses.copy()
    angle = np.radians(4.0)
    R = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    turned[:, :3, 3], turned[:, :3, :3] = 1.2 * turned[:, :3, 3] @ R.T, R @ turned[:, :3, :3]
    path = VideoPath(t_s=path.t_s, poses=turned, moving=path.moving)
    fits, errors = live(drive, path, drive.fixes([FixClass.RTK_FIX] * 30, np.zeros((30, 3))))
    assert np.linalg.norm(errors[-1]) < 0.02
    np.testing.assert_allclose(np.exp(fits[-1].state.values[-1, 3]), 1.0 / 1.2, rtol=1e-3)
    first, last = (np.diag(fit.covariance)[3:7] for fit in (fits[0], fits[-1]))
    assert (first > last).all()


def turned(path, map_turn_deg, mount_roll_deg):
    """A path in a map that is turned about east, seen by a camera that is rolled about its axis."""
    turn, roll = (
        Rotation.from_euler(axis, angle, degrees=True).as_matrix()
        for axis, angle in (("x", map_turn_deg), ("z", mount_roll_deg))
    )
    poses = path.poses.copy()
    poses[:, :3, :3] = turn @ poses[:, :3, :3] @ roll
    poses[:, :3, 3] = poses[:, :3, 3] @ turn.T
    return VideoPath(t_s=path.t_s, poses=poses, moving=path.moving), LeverArm.within(roll.T @ ANTENNA)


@pytest.mark.parametrize(("mount_roll_deg", "limit_deg"), [(0.0, 0.7), (8.0, 1.5), (-30.0, 2.0)])
def test_floats_do_not_tilt_the_path_whatever_the_roll_of_the_mounting(mount_roll_deg, limit_deg):
    drive = DrivingCamera(400)
    path, arm = turned(drive.seen(), 3.0, mount_roll_deg)
    kinds, wrong = fixed_then_float(4, 36, [0.0, 0.0, 1.0])
    wrong[:, 2] *= np.arange(40) / 10.0  # a height that drifts looks like a slope
    fits = []
    for last in (60, 120, 200, 400):
        fits.append(fuse(cut(path, 0, last), drive.fixes(kinds, wrong), arm, CONFIG, (fits or [None])[-1]))
    up = fits[-1].state.world_R_map[-1] @ Rotation.from_euler("x", 3.0, degrees=True).as_matrix()
    assert np.degrees(np.arccos(up[2, 2])) < limit_deg
    found_deg = np.degrees(np.arcsin(fits[-1].state.values[-1, MEAN_ROLL]))
    assert abs(abs(found_deg) - abs(mount_roll_deg)) < limit_deg


def test_the_roll_of_the_mounting_that_a_straight_hides_is_in_the_sigmas():
    """The antenna is a metre above the camera, so that seven degrees are 0.12 m to one side."""
    drive = DrivingCamera(100)
    drive.true[:, :3, :3] = drive.true[0, :3, :3]
    drive.true[:, :3, 3] = drive.t_s[:, None] * [0.0, SPEED_M_S, 0.0]
    path, arm = turned(drive.seen(), 0.0, 7.0)
    fixes = drive.fixes([FixClass.RTK_FIX] * 10, np.zeros((10, 3)))
    fit = fuse(path, fixes, arm, CONFIG, None)
    error = fit.world_T_camera(path)[-1, :3, 3] - drive.true[-1, :3, 3]
    sigma = np.sqrt(np.diag(fit.covariance_at_end(path, CONFIG)))[:3]
    assert abs(error[0]) == pytest.approx(0.12, abs=0.02)
    assert sigma[0] == pytest.approx(np.radians(CONFIG.start.level_sigma_deg), rel=0.2)  # at a metre


@pytest.mark.slow
def test_what_has_left_the_path_stays_as_a_prior():
    drive = DrivingCamera(400)
    fixes = drive.fixes(*fixed_then_float(15, 25, [1.0, 1.0, 2.0]))
    path = drive.seen(np.random.default_rng(2), share=0.3)
    (*_, whole), errors = live(drive, path, fixes)
    (*_, short), short_errors = live(drive, path, fixes, horizon=100)
    assert len(short.nodes.t_s) < 0.4 * len(whole.nodes.t_s)
    sigma = np.sqrt(np.diag(whole.covariance))[:3]
    # later fixes cannot change earlier linearisations any more
    assert (np.abs(errors[-1] - short_errors[-1]) < sigma).all()
    np.testing.assert_allclose(np.sqrt(np.diag(short.covariance))[:3], sigma, rtol=0.3)


@pytest.mark.slow
def test_poses_between_nodes_are_those_of_the_nodes_where_the_video_is_exact():
    drive = DrivingCamera(200)
    fits, _ = live(drive, drive.seen(), drive.fixes([FixClass.RTK_FIX] * 20, np.zeros((20, 3))))
    path = cut(drive.seen(), 0, 195)
    found = fits[-1].world_T_camera(path)
    np.testing.assert_allclose(found, drive.true[:195], atol=2e-3)
    to_world = fits[-1].to_world(path)
    end = to_world.scale * to_world.world_R_map @ path.poses[-1, :3, 3] + to_world.world_p_map
    np.testing.assert_allclose(end, found[-1, :3, 3], atol=1e-9)


def test_sigmas_grow_with_the_distance_from_the_last_fix():
    drive = DrivingCamera(600)
    fixes = drive.fixes([FixClass.RTK_FIX] * 20, np.zeros((20, 3)))
    fit = fuse(cut(drive.seen(), 0, 200), fixes, ARM, CONFIG, None)
    sigma = [
        np.sqrt(np.trace(fit.covariance_at_end(cut(drive.seen(), 0, last), CONFIG)[:3, :3]))
        for last in (200, 250, 300, 600)
    ]
    assert sigma[0] < 0.4 and (np.diff(sigma) > 0.0).all() and 1.0 < sigma[-1] < 50.0


def bent(drive, bends_rad, seed=0):
    """The path of a video whose map bends at random in its first 60 frames, and by how much it may."""
    bending = np.where(np.arange(len(drive.t_s)) < 60, bends_rad**2 / 60.0, 0.0)
    walk = np.random.default_rng(seed).standard_normal((len(bending), 3)) * np.sqrt(bending)[:, None]
    R = Rotation.from_rotvec(np.cumsum(walk, axis=0)).as_matrix()
    path = drive.seen()
    poses, steps = path.poses.copy(), np.diff(path.poses[:, :3, 3], axis=0)
    poses[1:, :3, 3] = poses[0, :3, 3] + np.cumsum((R[1:] @ steps[:, :, None])[:, :, 0], axis=0)
    poses[:, :3, :3] = R @ poses[:, :3, :3]
    return replace(path, poses=poses, bending=bending)


@pytest.mark.slow
def test_the_heading_of_a_young_map_that_is_bent_is_as_sure_as_stated():
    drive = DrivingCamera(80)
    fixes = drive.fixes([FixClass.RTK_FIX] * 4, np.zeros((4, 3)), every=20)

    def squared_deviation(path):
        fit = fuse(path, fixes, ARM, CONFIG, None)
        off = Rotation.from_matrix(fit.world_T_camera(path)[-1, :3, :3] @ drive.true[-1, :3, :3].T)
        return off.as_rotvec()[2] ** 2 / fit.covariance_at_end(path, CONFIG)[6, 6]

    paths = [bent(drive, 0.2, seed) for seed in range(16)]
    assert np.mean([squared_deviation(replace(path, bending=None)) for path in paths]) > 4.0
    assert 0.4 < np.mean([squared_deviation(path) for path in paths]) < 1.6


def test_a_path_since_a_time_has_the_bending_since_then():
    path = bent(DrivingCamera(100), 0.1)
    later = path.since(float(path.t_s[20]))
    at = path.t_s[[25, 40]]
    np.testing.assert_allclose(np.diff(later.bent(at)), np.diff(path.bent(at)))
    np.testing.assert_allclose(np.diff(path.bent(at)), 15 * 0.1**2 / 60.0)


def simulated_nees(seed):
    """Squared error over covariance of the newest position, after RTK-fixes and as many RTK-floats."""
    rng, drive = np.random.default_rng(seed), DrivingCamera(300)
    kinds, wrong = fixed_then_float(15, 15, np.ones(3))
    floating, noise = wrong[:, :1], rng.standard_normal((30, 3))
    own = CONFIG.gps.memory.classes[FixClass.RTK_FLOAT]
    spreads = own.between_receivers, own.walk_spread, own.noise_spread
    receiver, walking, noisy = np.exp(np.array(spreads) * rng.standard_normal(3))
    size = receiver * np.array([own.r_m / 2.45, own.r_m / 2.45, own.h_m / 1.96])
    walk = walking * own.walk_m * np.array([1.0, 1.0, own.vertical]) * rng.standard_t(3.0, (30, 3))
    offset = size * rng.standard_normal(3) + np.cumsum(walk, axis=0)
    fixes = drive.fixes(
        kinds, floating * (offset + noisy * own.noise_m * noise) + (1.0 - floating) * 0.005 * noise
    )
    fits, errors = live(drive, drive.seen(rng), fixes, every=25)
    covariance = fits[-1].covariance[:3, :3]
    return errors[-1] @ np.linalg.solve(covariance, errors[-1])


@pytest.mark.slow
def test_covariances_are_those_of_the_errors():
    """Receivers differ by log-normal factors, so that the mean over few of them means nothing."""
    nees = np.array([simulated_nees(seed) for seed in range(24)])
    assert np.mean(nees < chi2.ppf(0.95, 3)) > 0.8
    assert 0.3 < np.median(nees) < chi2.median(3)


SAME_CLOCK = vgps.Config.model_validate({"sensors": {"estimate_time_offset": "no"}})


def winding_with_antenna(arm, seed=0):
    """The path of a winding road, and its fit with RTK-fixes of an antenna of which that much is known."""
    drive = DrivingCamera(400)
    fixes = drive.fixes([FixClass.RTK_FIX] * 40, np.zeros((40, 3)))
    path = drive.seen(np.random.default_rng(seed), share=0.5)
    return path, fuse(path, fixes, arm, SAME_CLOCK, None)


@pytest.mark.parametrize("seed", range(4))
def test_turns_show_how_far_ahead_an_antenna_is_that_nobody_measured_but_not_how_high(seed):
    _, fit = winding_with_antenna(LeverArm.within(np.zeros(3), 1.0), seed)
    away, sigma_m = fit.lever_arm.camera_p_antenna - ANTENNA, fit.lever_arm.sigma_m
    assert sigma_m[2] < 0.2 and sigma_m[1] == pytest.approx(1.0, abs=0.01)
    assert (np.abs(away) < 3.0 * sigma_m).all()


def test_what_was_known_of_an_antenna_counts():
    known = LeverArm(ANTENNA + np.array([0.0, 0.2, 0.0]), np.diag([1.0, 0.01, 1.0]))
    _, fit = winding_with_antenna(known)
    assert fit.lever_arm.camera_p_antenna[1] == pytest.approx(ANTENNA[1] + 0.2, abs=0.02)
    assert fit.lever_arm.sigma_m[1] == pytest.approx(0.1, abs=0.005) and fit.lever_arm.sigma_m[2] < 0.2
    _, held = winding_with_antenna(ARM)
    np.testing.assert_allclose(held.lever_arm.camera_p_antenna, ANTENNA, atol=1e-3)


def test_the_antennas_place_is_known_where_the_cameras_is_not():
    path, fit = winding_with_antenna(LeverArm.within(np.zeros(3), 1.0))
    camera_m2 = np.diagonal(fit.covariance_at_end(path, SAME_CLOCK))[:3]
    antenna_m2 = np.diagonal(fit.antenna_covariance_at_end(path, SAME_CLOCK))
    assert camera_m2.sum() > 1.8 and antenna_m2.sum() < 0.1


def test_a_turn_that_shows_the_lever_arm_moves_the_camera_and_not_the_antenna():
    """The camera moves by what the lever arm was wrong by, which is no reason to doubt fixes."""
    drive, fits, camera_m, antenna_m = DrivingCamera(200), [], [], []
    fixes, path = drive.fixes([FixClass.RTK_FIX] * 20, np.zeros((20, 3))), drive.seen()
    arm = LeverArm.within(ANTENNA - np.array([0.0, 0.0, 1.5]), 1.0)
    for last in range(25, 201, 10):
        part = cut(path, 0, last)
        fits.append(fuse(part, fixes, arm, SAME_CLOCK, fits[-1] if fits else None))
        if len(fits) > 1:
            end, (before, now) = part.poses[-1:, :3, 3], fits[-2:]
            camera_m.append((now.to_world(part).points(end) - before.to_world(part).points(end))[0])
            antenna_m.append(now.moved_from(before, part))
            spread = before.antenna_covariance_at_end(part, SAME_CLOCK)
            assert antenna_m[-1] @ np.linalg.solve(spread, antenna_m[-1]) < 9.0
    camera_m, antenna_m = (np.linalg.norm(moved, axis=1) for moved in (camera_m, antenna_m))
    assert camera_m.sum() > 1.2 and antenna_m.sum() < 0.5 * camera_m.sum()
