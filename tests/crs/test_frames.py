import numpy as np
from scipy.spatial.transform import Rotation
from solutions import make_poses

from vgps.crs import coordinate_system
from vgps.crs.frames import local_R_world, poses_in_system, poses_in_world
from vgps.model import GeodeticPoint

ORIGIN = GeodeticPoint(49.0, 8.4, 160.0)


def poses(count=20):
    rng = np.random.default_rng(0)
    rotations = Rotation.random(count, random_state=1).as_matrix()
    return make_poses(rng.uniform(-500, 500, (count, 3)), rotations)


def test_grid_north_differs_by_the_convergence():
    system = coordinate_system(ORIGIN[:2], "EPSG:32632")
    turned = poses_in_system(system, ORIGIN, np.eye(4)[None])[0]
    # west of the central meridian, true north lies to the right of grid north
    convergence = np.arctan(np.tan(np.radians(9.0 - 8.4)) * np.sin(np.radians(49.0)))
    np.testing.assert_allclose(turned[:3, 1], [np.sin(convergence), np.cos(convergence), 0], atol=1e-6)


def test_poses_there_and_back():
    for crs, geoid in (("EPSG:25832", "egm96"), ("EPSG:31467", None), ("EPSG:4978", None)):
        system = coordinate_system(ORIGIN[:2], crs, geoid)
        back = poses_in_world(system, ORIGIN, poses_in_system(system, ORIGIN, poses()))
        np.testing.assert_allclose(back[:, :3, 3], poses()[:, :3, 3], atol=1e-4)
        np.testing.assert_allclose(back[:, :3, :3], poses()[:, :3, :3], atol=1e-9)


def test_the_local_vertical_turns_with_the_earth():
    # a degree further north the vertical leans by a degree about the east
    turned = local_R_world(ORIGIN, np.array([[50.0, 8.4]]))[0]
    np.testing.assert_allclose(
        turned @ [0, 0, 1], [0, -np.sin(np.radians(1)), np.cos(np.radians(1))], atol=1e-9
    )
