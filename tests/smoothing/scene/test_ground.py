from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_bundle import ANTENNA
from synthetic_fixes import fixes_of_size
from synthetic_map import MATRIX, context

from vgps.config import BatchConfig, Config, StartConfig
from vgps.geometry import project
from vgps.gps.sensors import Sensors
from vgps.smoothing.scene.ground import find_ground, terrain
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.solution import Observations, Trajectory

EAST = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # world_R_camera of one looking east
HEIGHT_M = 1.6
ROAD = terrain(StartConfig())
RNG = np.random.default_rng(0)


def straight_path(frames=60, step_m=1.0):
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = EAST
    poses[:, 0, 3], poses[:, 2, 3] = step_m * np.arange(frames), HEIGHT_M
    return Trajectory(0.1 * np.arange(frames), poses)


def ground_points(slope=lambda x: 0.0 * x, count=1500):
    """Return landmarks (count, 3) on a road that falls to the south, the right of the path, by a slope(x)."""
    x, y = RNG.uniform(0, 80, count), RNG.uniform(-5, 5, count)
    return np.column_stack([x, y, slope(x) * y + RNG.normal(scale=0.01, size=count)])


def walls(count=800):
    x, side = RNG.uniform(0, 80, count), RNG.choice([-6.0, 6.0], count)
    return np.column_stack([x, side, RNG.uniform(0.0, 8.0, count)])


def seen_ahead(path, points, reach_m=20.0):
    ahead = points[:, 0] - path.world_T_camera[:, 0, 3][:, None]
    frame, landmark = np.nonzero((ahead > 2.0) & (ahead < reach_m))
    return Observations(frame, landmark, np.zeros((len(frame), 2)))


def turned(path, points, angle_deg):
    """Return path and points turned about the path, as an estimate that is wrong in roll has them."""
    R = Rotation.from_rotvec([np.radians(angle_deg), 0.0, 0.0]).as_matrix()
    poses = path.world_T_camera.copy()
    poses[:, :3, :3], poses[:, :3, 3] = R @ poses[:, :3, :3], poses[:, :3, 3] @ R.T
    return replace(path, world_T_camera=poses), points @ R.T


def elevations_deg(ground, path):
    up = path.world_T_camera[ground.frame, 2, :3]
    return np.degrees(np.arcsin(np.einsum("si,si->s", up, ground.camera_level)))


@pytest.mark.parametrize("angle_deg", [0.0, 12.0, -20.0])
@pytest.mark.parametrize("roll_deg", [0.0, 30.0])
def test_level_ground_tells_how_far_an_estimate_is_turned(angle_deg, roll_deg):
    path, points = straight_path(), np.vstack([ground_points(), walls()])
    poses = path.world_T_camera.copy()
    poses[:, :3, :3] = EAST @ Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()
    path, moved = turned(replace(path, world_T_camera=poses), points, angle_deg)
    ground = find_ground(path, moved, seen_ahead(path, points), ROAD)
    np.testing.assert_allclose(elevations_deg(ground, path), -angle_deg, atol=0.2)
    assert len(ground.frame) == 6
    of_mean = np.sqrt((ground.sigma_rad**2).sum()) / len(ground.frame)
    assert ROAD.slope_sigma_rad <= of_mean < 1.05 * ROAD.slope_sigma_rad


def test_a_road_that_falls_to_the_side_is_taken_for_level():
    path, points = straight_path(), ground_points(lambda x: 0.02 + 0.0 * x)
    ground = find_ground(path, points, seen_ahead(path, points), ROAD)
    np.testing.assert_allclose(elevations_deg(ground, path), np.degrees(np.arctan(-0.02)), atol=0.1)


def test_a_bank_beside_one_stretch_is_left_out():
    path = straight_path(100)
    points = ground_points(lambda x: np.where((x > 40) & (x < 50), 0.3, 0.0), 2500)
    ground = find_ground(path, points, seen_ahead(path, points, 10.0), ROAD)
    assert np.abs(elevations_deg(ground, path)).max() < 3.0
    assert len(ground.frame) < 8


def test_walls_a_cloud_a_drone_few_landmarks_and_a_standing_camera_have_no_ground():
    path = straight_path()
    cloud = RNG.uniform([0, -20, -20], [80, 20, 20], (1500, 3))
    far_below = ground_points() - [0.0, 0.0, 8.0]  # under a drone
    for points in (walls(), cloud, far_below, ground_points(count=25)):
        assert find_ground(path, points, seen_ahead(path, points), ROAD) is None
    standing, points = straight_path(step_m=1e-3), ground_points()
    assert find_ground(standing, points, seen_ahead(standing, points), ROAD) is None


def test_no_stretch_spans_two_runs():
    path, points = straight_path(), ground_points()
    t_s = path.t_s + np.where(np.arange(60) < 25, 0.0, 1e4)
    apart = find_ground(replace(path, t_s=t_s), points, seen_ahead(path, points), ROAD)
    together = find_ground(path, points, seen_ahead(path, points), ROAD)
    assert together.frame.tolist() == [5, 15, 25, 35, 45, 55]
    assert not {24, 25, 26} & set(apart.frame.tolist())


def seen_by(path, points):
    """Return the observations of landmarks 2 to 30 m ahead within the picture, with noise of 0.2 px."""
    uv, depth = project(MATRIX, path.world_T_camera, points)
    inside = (depth > 2.0) & (depth < 30.0) & (uv > 0).all(axis=2) & (uv < [640, 480]).all(axis=2)
    return Observations(*np.nonzero(inside), uv[inside] + RNG.normal(scale=0.2, size=(inside.sum(), 2)))


def roll_error_deg(crossfall_sigma_deg):
    """Return the error in roll of stage D on a straight road, of a camera mounted 15 degrees askew."""
    path, points = straight_path(frames=40), np.vstack([ground_points(count=1000), walls(500)])
    true = path.world_T_camera.copy()
    true[:, :3, :3] = EAST @ Rotation.from_euler("z", 15.0, degrees=True).as_matrix()
    true_path = replace(path, world_T_camera=true)
    start, moved = turned(true_path, points, -10.0)
    scene = Scene(path.t_s, start.world_T_camera, moved, seen_by(true_path, points))
    row, size = np.arange(0, 39, 4), np.full(10, 0.02)
    antenna = true[row, :3, 3] + true[row, :3, :3] @ ANTENNA
    fixes = fixes_of_size(path.t_s[row], antenna, size, size, correlation_s=np.full(10, 10.0))
    settings = Config(start=StartConfig(crossfall_sigma_deg=crossfall_sigma_deg))
    found = optimise_batch(scene, fixes, Sensors.fixed(ANTENNA), context(settings)).trajectory.world_T_camera
    turn = Rotation.from_matrix(found[:, :3, :3] @ true[:, :3, :3].swapaxes(1, 2)).as_rotvec(degrees=True)
    return float(np.abs(turn[:, 0]).mean())


@pytest.mark.slow
def test_a_camera_held_askew_is_turned_by_the_road_and_not_by_the_prior_of_a_level_one():
    assert roll_error_deg(1.5) < 1.0
    assert roll_error_deg(1000.0) > 3.0


def test_land_under_a_drone_is_ground_where_the_camera_flies():
    path, points = straight_path(), ground_points() - [0.0, 0.0, 20.0]
    land = terrain(StartConfig(airborne="yes"))
    moved_path, moved = turned(path, points, 12.0)
    ground = find_ground(moved_path, moved, seen_ahead(path, points), land)
    np.testing.assert_allclose(elevations_deg(ground, moved_path), -12.0, atol=0.2)
    of_mean = np.sqrt((ground.sigma_rad**2).sum()) / len(ground.frame)
    assert np.degrees(of_mean) == pytest.approx(10.0, rel=0.05)


def pitch_error_deg(airborne, rounds):
    """Return the error of stage D on a straight flight sideways, looking down by 60 degrees."""
    path, height_m = straight_path(frames=40), 30.0
    true = path.world_T_camera.copy()
    true[:, :3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]] @ Rotation.from_euler(
        "x", -60.0, degrees=True
    ).as_matrix()
    true[:, 2, 3] = height_m
    points = RNG.uniform([-20, 0, -0.3], [60, 50, 0.3], (1500, 3))
    uv, depth = project(MATRIX, true, points)
    inside = (depth > 2.0) & (uv > 0).all(axis=2) & (uv < [640, 480]).all(axis=2)
    seen = Observations(*np.nonzero(inside), uv[inside] + RNG.normal(scale=0.2, size=(inside.sum(), 2)))
    row, size = np.arange(0, 39, 4), np.full(10, 2.0)
    fixes = fixes_of_size(path.t_s[row], true[row, :3, 3], size, size, correlation_s=np.full(10, 10.0))
    settings = Config(start=StartConfig(airborne=airborne), batch=BatchConfig(rounds=rounds))
    scene = Scene(path.t_s, true, points, seen)
    found = optimise_batch(scene, fixes, Sensors.fixed(np.zeros(3)), context(settings)).trajectory
    turn = Rotation.from_matrix(found.world_T_camera[:, :3, :3] @ true[:, :3, :3].swapaxes(1, 2))
    return float(np.degrees(turn.magnitude()).mean())


@pytest.mark.slow
def test_a_drone_that_flies_sideways_is_held_by_the_land_and_not_by_the_prior_of_a_level_camera():
    assert pitch_error_deg("yes", rounds=3) < 0.4
    assert pitch_error_deg("no", rounds=3) > 10.0


@pytest.mark.slow
def test_the_first_round_has_the_land_under_a_drone():
    assert pitch_error_deg("yes", rounds=1) < 1.0
