from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import fixes_of_size

from vgps.config import Config
from vgps.gps.offset_errors import averaged_over_receivers, errors_of
from vgps.online.fusion.live_time_offset import LiveTimeOffset
from vgps.online.fusion.node_fixes import node_fixes, seen_fixes
from vgps.online.fusion.video_path import VideoPath

SPEED_M_S = 2.0


def straight_path() -> VideoPath:
    """A second along x, without rotation."""
    t_s = np.linspace(0.0, 1.0, 11)
    poses = np.tile(np.eye(4), (len(t_s), 1, 1))
    poses[:, 0, 3] = SPEED_M_S * t_s
    return VideoPath(t_s=t_s, poses=poses, moving=np.ones(len(t_s), bool))


def fixes_at(*t_s: float):
    return fixes_of_size(
        np.array(t_s), np.zeros((len(t_s), 3)), np.full(len(t_s), 0.05), np.full(len(t_s), 0.1)
    )


def test_fixes_are_seen_where_the_camera_was_when_they_were_taken():
    seen = seen_fixes(straight_path(), fixes_at(0.1, 0.5, 1.0, 1.2), LiveTimeOffset(0.25, 0.0, 0.0))
    assert seen.fixes.t_s.tolist() == [0.1, 0.5, 1.0]
    # the first was taken before the path begins: its first pose stands for it, the offset for the time since
    np.testing.assert_allclose(seen.time_offset_s, [0.1, 0.25, 0.25])
    np.testing.assert_allclose(seen.camera[:, 0, 3], [0.0, 0.5, 1.5], atol=1e-12)
    np.testing.assert_allclose(seen.velocity, np.tile([SPEED_M_S, 0.0, 0.0], (3, 1)), atol=1e-9)


def test_velocities_are_means_over_the_uncertainty_of_the_time_offset_and_bends_depart_from_them():
    path = straight_path()
    path.poses[:, 1, 3] = 0.5 * path.t_s**2
    seen = seen_fixes(path, fixes_at(0.4, 0.5), LiveTimeOffset(0.0, 0.0, 0.3))
    np.testing.assert_allclose(seen.velocity[:, :2], [[SPEED_M_S, 0.4], [SPEED_M_S, 0.5]], atol=1e-9)
    np.testing.assert_allclose(seen.bend, 0.5 * 0.3**2, atol=1e-9)
    assert seen_fixes(straight_path(), fixes_at(0.5), LiveTimeOffset(0.0, 0.0, 0.3)).bend < 1e-9
    tied = node_fixes(seen, path.at(np.array([0.4, 0.5])), np.array([0, 1]), Config())
    np.testing.assert_allclose(
        tied.with_bends(np.array([1.0, 2.0])).noise_m[:, 2], np.hypot(tied.noise_m[:, 2], [0.045, 0.09])
    )


def test_fixes_of_a_clock_that_is_behind_wait_for_the_frames_of_their_time():
    seen = seen_fixes(straight_path(), fixes_at(0.5, 0.8), LiveTimeOffset(-0.3, 0.0, 0.0))
    assert seen.fixes.t_s.tolist() == [0.5]
    assert seen.camera[0, 0, 3] == pytest.approx(SPEED_M_S * 0.8)


def test_fixes_are_tied_to_their_nodes_by_the_cameras_step():
    path = straight_path()
    seen = seen_fixes(path, fixes_at(0.3, 0.7), LiveTimeOffset(0.1, 0.0, 0.0))
    tied = node_fixes(seen, path.at(np.array([0.0, 0.7])), np.array([0, 1]), Config())
    np.testing.assert_allclose(tied.step[:, 0], [0.4, -0.2], atol=1e-12)
    np.testing.assert_allclose(tied.axes, np.tile(np.eye(3), (2, 1, 1)), atol=1e-12)
    assert (tied.noise_m > 0.0).all() and tied.noise_m.shape == (2, 3)


def test_the_walk_of_an_offset_since_its_first_fix_is_part_of_the_noise_of_the_others():
    path, node = straight_path(), np.array([0, 0, 0, 1])
    seen = seen_fixes(path, fixes_at(0.1, 0.2, 0.3, 0.4), LiveTimeOffset(0.0, 0.0, 0.0))
    tied = node_fixes(seen, path.at(np.array([0.1, 0.4])), node, Config())
    errors = averaged_over_receivers(errors_of(seen.fixes, Config().gps)[0])
    walked_m = errors.walk_m * np.sqrt(errors.rate_lasts_s * np.array([0.0, 0.1, 0.2, 0.0]))
    np.testing.assert_allclose(tied.noise_m[:, 0], np.hypot(errors.noise_m, walked_m))
    np.testing.assert_allclose(tied.noise_m[:, 2], errors.vertical * tied.noise_m[:, 0])


def test_the_errors_of_the_last_digits_are_part_of_the_noise():
    path, fixes, logging_sigma_m = straight_path(), fixes_at(0.1, 0.5), np.array([[0.3, 0.4, 0.5], [0.0] * 3])
    camera, node = path.at(np.array([0.1, 0.5])), np.array([0, 1])

    def noise_m(fixes):
        seen = seen_fixes(path, fixes, LiveTimeOffset(0.0, 0.0, 0.0))
        return node_fixes(seen, camera, node, Config()).noise_m

    rounded = replace(fixes, logging_sigma_m=logging_sigma_m)
    np.testing.assert_allclose(noise_m(rounded), np.hypot(noise_m(fixes), logging_sigma_m))
