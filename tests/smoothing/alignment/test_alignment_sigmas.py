import numpy as np
from scipy.spatial.transform import Rotation
from synthetic_fixes import poses

from vgps.mapping.map_update import Similarity
from vgps.smoothing.alignment.alignment_sigmas import bending_covariances
from vgps.smoothing.alignment.similarity import Correspondences

TURNED = 0.01**2 * np.array([0.0, 1.0, 2.0])


def seen(centres):
    at = poses(np.asarray(centres, dtype=float))
    return Correspondences(
        map_T_camera=at,
        world_p_fix=np.zeros((len(at), 3)),
        region_m=np.ones((len(at), 3)),
        camera_p_antenna=np.zeros(3),
    )


def test_a_climb_of_two_steps_goes_aside_by_the_turns_of_both():
    """By hand: theta_1 h and (theta_1 + theta_2) h, of variances v, 2 v and covariance v, h = 3 m."""
    in_map = Similarity(3.0, np.eye(3), np.zeros(3))
    found = bending_covariances(seen([[0, 0, 0], [0, 0, 1], [0, 0, 2]]), in_map, TURNED)
    aside = 9.0 * 0.01**2 * np.array([[0, 0, 0], [0, 1, 2], [0, 2, 5]])
    np.testing.assert_allclose(found, [aside, aside, np.zeros((3, 3))], atol=1e-12)


def test_covariances_are_those_of_paths_that_a_random_walk_turns():
    rng = np.random.default_rng(0)
    turn = Similarity(2.0, Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix(), np.ones(3))
    given = seen(np.cumsum(rng.normal(1.0, 1.0, (6, 3)), axis=0))
    turned = np.cumsum(rng.uniform(0.0, 2e-4, 6))
    step = np.diff(turn.points(given.map_T_camera[:, :3, 3]), axis=0)
    growth = np.sqrt(np.diff(turned, prepend=0.0))[:, None]
    walk = np.cumsum(rng.normal(size=(20_000, 6, 3)) * growth, axis=1)[:, 1:]
    strayed = np.cumsum(np.cross(walk, step), axis=1)
    drawn = np.einsum("dia,dja->aij", strayed, strayed) / len(strayed)
    found = bending_covariances(given, turn, turned)
    np.testing.assert_array_equal(found[:, 0], 0.0)
    np.testing.assert_allclose(found[:, 1:, 1:], drawn, atol=0.05 * found.max())
