from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.config import StartConfig
from vgps.gps.antenna_path import place
from vgps.mapping.map_update import Similarity
from vgps.smoothing.alignment.alignment_sigmas import (
    AlignmentSigmas,
    alignment_sigmas,
    antenna_covariances,
    jackknife_sigmas,
)
from vgps.smoothing.alignment.similarity import Correspondences, _moved, align, covariance, linearise

CONFIG = StartConfig()
SAME = Similarity(1.0, np.eye(3), np.zeros(3))
ANTENNA = np.array([0.1, -0.9, -0.3])
LOOKS_NORTH = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def drive(turn_rad, frames=12):
    """World poses on an arc of 40 m, upright, looking ahead."""
    angle = np.linspace(0, turn_rad, frames)
    step = 40 / frames * np.stack([np.sin(angle), np.cos(angle), np.zeros(frames)], axis=1)
    out = np.tile(np.eye(4), (frames, 1, 1))
    out[:, :3, 3] = np.array([100.0, -50.0, 7.0]) + np.cumsum(step, axis=0)
    out[:, :3, :3] = Rotation.from_rotvec(-angle[:, None] * [0, 0, 1]).as_matrix() @ LOOKS_NORTH
    return out


def in_map(world, scale, rotation, place_):
    out = world.copy()
    out[:, :3, 3] = (world[:, :3, 3] - place_) @ rotation / scale
    out[:, :3, :3] = rotation.T @ world[:, :3, :3]
    return out


def seen_by(map_T_camera, fixes, region_m):
    """Correspondences with regions of one size."""
    region = np.full((len(fixes), 3), region_m)
    return Correspondences(
        map_T_camera=map_T_camera, world_p_fix=fixes, region_m=region, camera_p_antenna=ANTENNA
    )


def antennas(world):
    return world[:, :3, :3] @ ANTENNA + world[:, :3, 3]


@pytest.mark.parametrize("turn_rad", [1.2, 0.0])
@pytest.mark.parametrize("outlier_m", [0.0, 15.0])
def test_recovers_the_similarity_with_the_lever_arm(turn_rad, outlier_m):
    world = drive(turn_rad)
    rotation, place_ = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix(), np.array([90.0, -40.0, 5.0])
    fixes = antennas(world)
    fixes[5, 0] += outlier_m
    found = align(seen_by(in_map(world, 3.7, rotation, place_), fixes, 0.07), CONFIG)
    assert found is not None and found.scale == pytest.approx(3.7, rel=0.01)
    assert np.degrees(Rotation.from_matrix(found.world_R_map @ rotation.T).magnitude()) < 1.0


def test_a_nearly_vertical_climb_keeps_the_shape_of_the_map():
    """A drone rises before it flies off: rotations must stay rotations."""
    world = drive(0.0)
    world[:, :3, 3] += np.linspace(0.0, 400.0, len(world))[:, None] * [0.0, 0.0, 1.0]
    found = align(seen_by(in_map(world, 3.7, np.eye(3), np.zeros(3)), antennas(world), 0.07), CONFIG)
    assert found is not None
    np.testing.assert_allclose(found.world_R_map @ found.world_R_map.T, np.eye(3), atol=1e-12)


def test_a_drone_that_climbs_and_leaves_looking_down_is_not_upside_down():
    """It leaves along the upper edge of its picture, which is up for a camera that looks ahead."""
    world = drive(0.0, frames=24)
    world[:, :3, :3] = LOOKS_NORTH @ Rotation.from_euler("x", -90.0, degrees=True).as_matrix()
    climbed = np.linspace(0.0, 2.0, 24).clip(max=1.0)
    world[:, :3, 3] = world[0, :3, 3] + 30 * climbed[:, None] * [0, 0, 1]
    world[:, 1, 3] += 60 * np.linspace(-1.0, 1.0, 24).clip(min=0.0)
    found = align(seen_by(in_map(world, 3.7, np.eye(3), np.zeros(3)), antennas(world), 3.0), CONFIG)
    assert np.degrees(Rotation.from_matrix(found.world_R_map).magnitude()) < 1.0


def sideways_flight(down_deg=60.0, roll_deg=0.0):
    """A straight flight to the east that looks north and down."""
    world = drive(0.0)
    turn = Rotation.from_euler("XZ", [-down_deg, roll_deg], degrees=True)
    world[:, :3, :3] = LOOKS_NORTH @ turn.as_matrix()
    world[:, :3, 3] = [100.0, -50.0, 47.0] + np.linspace(0.0, 40.0, len(world))[:, None] * [1, 0, 0]
    return world


@pytest.mark.parametrize("down_deg, roll_deg", [(60.0, 0.0), (20.0, 180.0)])
def test_the_land_shows_the_pitch_of_a_straight_sideways_flight(down_deg, roll_deg):
    world, flies = sideways_flight(down_deg, roll_deg), StartConfig(airborne="yes")
    rotation = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix()
    fixes = world[:, :3, 3] + np.random.default_rng(0).normal(scale=0.1, size=(len(world), 3))
    blind = replace(
        seen_by(in_map(world, 3.7, rotation, np.zeros(3)), fixes, 3.0), camera_p_antenna=np.zeros(3)
    )
    seen = replace(blind, map_up=rotation.T @ [0.0, 0.0, 1.0])
    found = align(seen, flies)
    assert np.degrees(Rotation.from_matrix(found.world_R_map @ rotation.T).magnitude()) < 5.0
    errors = np.tile(0.01 * np.eye(len(world)), (3, 1, 1))
    assert np.degrees(alignment_sigmas(seen, found, errors, flies).tilt_rad) == pytest.approx(10.0, rel=0.2)
    guessed = alignment_sigmas(blind, align(blind, flies), errors, flies)
    assert np.degrees(guessed.tilt_rad) > 45.0


@pytest.mark.parametrize("turns, hangs", [(False, False), (True, True)])
def test_a_camera_hangs_only_where_fixes_show_it(turns, hangs):
    """A straight path that the camera looks across fits as well upside down."""
    angle = np.linspace(0.0, 1.2 if turns else 0.02, 12)
    world = np.tile(np.eye(4), (12, 1, 1))
    world[:, :3, 3] = 20.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle], axis=1)
    inward = Rotation.from_rotvec(angle[:, None] * [0, 0, 1]).as_matrix() @ LOOKS_NORTH
    world[:, :3, :3] = inward @ Rotation.from_euler("z", 180.0 * hangs, degrees=True).as_matrix()
    fixes = antennas(world) - 0.4 * np.gradient(world[:, :3, 3], axis=0)
    rotation = Rotation.from_rotvec([0.4, -1.0, 2.0]).as_matrix()
    found = align(seen_by(in_map(world, 3.7, rotation, np.zeros(3)), fixes, [0.07, 0.07, 0.05]), CONFIG)
    assert np.degrees(Rotation.from_matrix(found.world_R_map @ rotation.T).magnitude()) < 6.0


def flight_after_a_turn(rate_deg_s, down_deg, course_deg):
    """A drone that turns on the spot for 10 s and flies off for 2 s, at 3 Hz."""
    t_s = np.arange(36) / 3.0
    yaw = np.radians(rate_deg_s) * np.minimum(t_s, 10.0)
    along_m = 2.0 / 3.0 * np.maximum(t_s - 10.0, 0.0) ** 2
    course = yaw[-1] + np.radians(course_deg)
    world = np.tile(np.eye(4), (len(t_s), 1, 1))
    world[:, :3, :3] = Rotation.from_euler("z", yaw[:, None]).as_matrix() @ LOOKS_NORTH
    world[:, :3, :3] = world[:, :3, :3] @ Rotation.from_euler("x", -down_deg, degrees=True).as_matrix()
    world[:, :3, 3] = along_m[:, None] * [-np.sin(course), np.cos(course), 0.0]
    return world


@pytest.mark.parametrize("land", [True, False])
def test_a_turn_on_the_spot_before_a_flight_does_not_turn_it_over(land):
    """Fixes that walk while it hovers give a start with any heading."""
    over = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        world = flight_after_a_turn(*rng.uniform([5, 0, -180], [15, 60, 180]))
        fixes = world[:, :3, 3] + np.cumsum(rng.normal(scale=0.03, size=(len(world), 3)), axis=0)
        seen = replace(seen_by(world, fixes, 3.0), camera_p_antenna=np.zeros(3))
        up = Rotation.from_rotvec(rng.normal(0, np.radians(4.0), 3)).apply([0.0, 0.0, 1.0])
        found = align(replace(seen, map_up=up if land else None), StartConfig(airborne="yes"))
        over.append(found.world_R_map[2, 2] < 0.0)
    assert not any(over)


def test_the_derivatives_are_those_of_the_residuals():
    world = drive(0.7)
    seen = seen_by(in_map(world, 2.0, np.eye(3), np.zeros(3)), antennas(world) + 0.05, 0.07)
    at = Similarity(2.1, Rotation.from_rotvec([0.05, 0.1, -0.1]).as_matrix(), np.array([0.3, 0.2, 0.1]))
    system, step = linearise(seen, at, CONFIG), 1e-6
    for k in range(7):
        ahead, behind = (
            linearise(seen, _moved(seen, at, sign * step * np.eye(7)[k]), CONFIG) for sign in (1, -1)
        )
        by_fix = (ahead.offset - behind.offset) / (2 * step)
        np.testing.assert_allclose(system.by_fix[:, :, k], by_fix, atol=1e-6)
        by_level = (ahead.level - behind.level) / (2 * step)
        np.testing.assert_allclose(system.by_level[:, k], by_level, atol=1e-6)
        # with Cauchy's loss, half the derivative of the cost is the weighted gradient
        by_cost = (ahead.cost - behind.cost) / (4 * step)
        assert system.gradient[k] == pytest.approx(by_cost, rel=1e-4, abs=1e-4)


@pytest.mark.slow
def test_the_covariance_is_that_of_repeated_alignments():
    """Fixes that share an offset of 1 m and have noise of 5 cm: the offset moves only the position."""
    world, rng = drive(1.0), np.random.default_rng(1)
    errors = np.tile(1.0 + 0.05**2 * np.eye(len(world)), (3, 1, 1))
    found = []
    for _ in range(300):
        error = rng.normal(0, 1.0, 3) + rng.normal(0, 0.05, (len(world), 3))
        at = align(seen_by(world, antennas(world) + error, 6.0), CONFIG)
        found.append([np.log(at.scale), *Rotation.from_matrix(at.world_R_map).as_rotvec()])
    predicted = covariance(linearise(seen_by(world, antennas(world), 6.0), SAME, CONFIG), errors)
    spread = np.std(found, axis=0)
    np.testing.assert_allclose(np.sqrt(np.diagonal(predicted))[[0, 3]], spread[[0, 3]], rtol=0.15)
    assert np.sqrt(predicted[4, 4]) == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize(("turn_rad", "tilt_deg"), [(1.2, (0.0, 1.0)), (0.0, (4.0, 6.0))])
def test_a_straight_path_leaves_the_roll_to_the_level_prior(turn_rad, tilt_deg):
    seen = seen_by(drive(turn_rad), antennas(drive(turn_rad)), 0.07)
    errors = np.tile(0.03**2 * np.eye(len(seen)), (3, 1, 1))
    sigmas = alignment_sigmas(seen, SAME, errors, CONFIG)
    assert sigmas.scale < 0.01 and np.degrees(sigmas.heading_rad) < 1.0
    assert tilt_deg[0] <= np.degrees(sigmas.tilt_rad) < tilt_deg[1]


def test_sigmas_grow_as_the_path_shrinks():
    """Errors of 3 cm on 12 places along 0.8 m: 3 cm / (0.8 m sqrt(12 / 12)), about 4 %."""
    world = drive(0.0)
    world[:, :3, 3] = world[0, :3, 3] + 0.02 * (world[:, :3, 3] - world[0, :3, 3])
    seen = seen_by(world, antennas(world), 0.07)
    sigmas = alignment_sigmas(seen, SAME, np.tile(0.03**2 * np.eye(12), (3, 1, 1)), CONFIG)
    assert sigmas.scale == pytest.approx(0.04, rel=0.15) and sigmas.within(CONFIG)
    sigmas = alignment_sigmas(seen, SAME, np.tile(0.06**2 * np.eye(12), (3, 1, 1)), CONFIG)
    assert not sigmas.within(CONFIG) and str(sigmas).startswith("scale 8%, heading 4 degrees, tilt ")


def test_an_unknown_lever_arm_counts_where_the_camera_turns():
    """A quarter turn to the right: what was an error to the east is one to the south then."""
    world = drive(np.pi / 2.0)
    seen = seen_by(world, antennas(world), 0.07)
    errors = antenna_covariances(seen, SAME, 2.0)
    for axis, end in zip(range(3), (0.0, 0.0, 4.0), strict=True):
        np.testing.assert_allclose(np.diagonal(errors[axis]), 4.0)
        assert errors[axis, 0, -1] == pytest.approx(end, abs=1e-9)
    noise = np.tile(0.01**2 * np.eye(len(seen)), (3, 1, 1))
    straight = seen_by(drive(0.0), antennas(drive(0.0)), 0.07)
    known, unknown, carried = (
        alignment_sigmas(one, SAME, noise + antenna_covariances(one, SAME, sigma_m), CONFIG)
        for one, sigma_m in ((seen, 0.0), (seen, 1.0), (straight, 1.0))
    )
    assert unknown.heading_rad > 5.0 * known.heading_rad
    assert carried.heading_rad < 2.0 * known.heading_rad
    # a metre that swings by a quarter turn, 1.4 m, along an arc of 36 m from end to end
    assert unknown.heading_rad == pytest.approx(1.4 / 36.0, rel=0.3)


def test_what_nothing_determines_is_unknown():
    assert str(AlignmentSigmas(1.5, 3.0, 0.1)) == "scale unknown, heading unknown, tilt 6 degrees"


@pytest.mark.slow
def test_leaving_out_a_part_shows_what_hangs_on_an_outlier():
    """During a stop a single outlier would give scale and heading."""
    world = drive(0.0, 20)
    world[:18, :3, 3] = world[0, :3, 3] + 1e-3 * (world[:18, :3, 3] - world[0, :3, 3])
    world[18:, :3, 3] = world[17, :3, 3] + [[0, 1e-3, 0], [0, 2e-3, 0]]
    fixes = antennas(world)
    fixes[19] += [15.0, 0.0, 0.0]
    seen = seen_by(world, fixes, 6.0)
    at = align(seen, CONFIG)
    assert alignment_sigmas(seen, at, np.tile(0.02**2 * np.eye(20), (3, 1, 1)), CONFIG).within(CONFIG)
    assert not jackknife_sigmas(seen, at, CONFIG).within(CONFIG, 4.0)
    moving = seen_by(drive(0.5, 20), antennas(drive(0.5, 20)), 6.0)
    assert jackknife_sigmas(moving, align(moving, CONFIG), CONFIG).within(CONFIG)


@pytest.mark.parametrize("count", [2, 12])
def test_fixes_at_one_place_align_the_map_at_a_scale_within_their_region(count):
    world = drive(0.0)[:count]
    found = align(seen_by(world, np.zeros((count, 3)), 0.5), CONFIG)
    extent = found.scale * np.linalg.norm(world[-1, :3, 3] - world[0, :3, 3])
    assert 0.1 < extent < 1.0
    assert align(seen_by(np.repeat(world[:1], count, axis=0), np.zeros((count, 3)), 0.5), CONFIG) is None


def test_fixes_are_placed_between_frames_by_time():
    placement = place(np.array([0.0, 0.1, 0.3]), np.array([-0.01, 0.0, 0.1, 0.25, 0.3, 0.31]))
    assert placement.inside.tolist() == [False, True, True, True, True, False]
    assert placement.frame[1:5].tolist() == [0, 1, 1, 1]
    np.testing.assert_allclose(placement.alpha[1:5], [0.0, 0.0, 0.75, 1.0])


def rolled(world, roll_deg):
    """The poses of a camera turned clockwise, as it looks."""
    out = world.copy()
    out[:, :3, :3] = world[:, :3, :3] @ Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()
    return out


@pytest.mark.parametrize("roll_deg", [90.0, 180.0, 270.0, 40.0])
def test_on_a_straight_a_camera_is_turned_as_it_is_stated(roll_deg):
    world = rolled(drive(0.0), roll_deg)
    start = StartConfig(roll_deg=roll_deg)
    found = align(seen_by(in_map(world, 2.0, np.eye(3), np.zeros(3)), antennas(world), 0.07), start)
    np.testing.assert_allclose(found.poses(in_map(world, 2.0, np.eye(3), np.zeros(3))), world, atol=1e-3)


@pytest.mark.parametrize("roll_deg", [90.0, 180.0, 270.0])
def test_in_a_turn_fixes_show_how_a_camera_is_turned(roll_deg):
    world = rolled(drive(1.2), roll_deg)
    found = align(seen_by(in_map(world, 2.0, np.eye(3), np.zeros(3)), antennas(world), 0.07), CONFIG)
    np.testing.assert_allclose(found.poses(in_map(world, 2.0, np.eye(3), np.zeros(3))), world, atol=0.05)


def test_on_a_straight_nothing_turns_an_upright_camera():
    world, rng = drive(0.0), np.random.default_rng(0)
    fixes = antennas(world) + rng.normal(0.0, [0.3, 0.3, 0.6], (len(world), 3))
    found = align(seen_by(world, fixes, 0.07), CONFIG)
    assert np.abs(found.poses(world)[:, 2, 0]).max() < 0.2 and (found.poses(world)[:, 2, 1] < -0.9).all()
