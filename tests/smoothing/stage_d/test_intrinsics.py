"""Self-calibration: a wrong calibration is corrected together with the poses, subject to its prior."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_bundle import ANTENNA, K
from synthetic_map import away, map_of, scene

from vgps.camera import distort, undistort
from vgps.config import BatchConfig, Config, IntrinsicsConfig, SensorsConfig
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import Camera, FocalChanges
from vgps.smoothing.calibration.camera_equations import changed_camera
from vgps.smoothing.calibration.focal_changes import without_change
from vgps.smoothing.calibration.refined_camera import prior_about
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.factor_graph import select_observations
from vgps.smoothing.scene.global_shutter import as_global_shutter
from vgps.smoothing.scene.other_calibration import misfit_px, seen_by, undistorted_by
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_d import intrinsics
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.smoothing.stage_d.intrinsics import _is_another_lens, refine_camera

CONFIG = Config(
    sensors=SensorsConfig(estimate_time_offset="no"),
    batch=BatchConfig(video_sigma_scale=4.0),  # synthetic observations are rough
)
TRUE = Camera(model="pinhole", width=640, height=480, fx=K[0], fy=K[1], cx=K[2], cy=K[3])
LENS = replace(TRUE, model="opencv", distortion=(-0.2, 0.05, 0.0, 0.0))


def refined(camera, wrong, zoom=0.0, **believed):
    """Stage D with a calibration that is wrong by ``wrong``, and a zoom to and fro; where it ends."""
    problem, poses, _, fixes = scene(disturbed=0.1)
    made, _ = scene_of_map(map_of(problem, 0, len(poses) - 1), 0, NO_CONTROL_OBSERVATIONS)
    if zoom:
        at_frame, seen = -zoom * np.sin(made.t_s), made.observations
        uv_px = without_change(seen.uv_px, TRUE, at_frame[seen.frame])
        made = replace(made, observations=replace(seen, uv_px=uv_px))
    start = changed_camera(camera, np.array(wrong))

    def optimise(scene, camera, every=None, sigma=None):
        if sigma is not None:  # all frames: their poses follow the centre
            turn = Rotation.from_matrix(made.poses[0, :3, :3].T @ scene.poses[0, :3, :3])
            shift_px = np.hypot(camera.cx - start.cx, camera.cy - start.cy)
            assert turn.magnitude() == pytest.approx(shift_px / camera.fx, abs=2e-3)
        return optimise_batch(scene, fixes, Sensors.fixed(ANTENNA), SmoothingContext(camera, CONFIG))

    settings = IntrinsicsConfig(refine=True, **believed)
    seen, prior = undistorted_by(start, camera, made), prior_about(start, settings)
    result, found = refine_camera(seen, start, prior, optimise, settings)
    return away(result.trajectory.world_T_camera, poses), start, found


@pytest.mark.slow
def test_focal_length_and_centre_are_recovered_within_their_sigmas():
    error_m, start, found = refined(TRUE, [0.03, 6.0, -4.0], focal_sigma=0.05, distortion_sigma=1e-4)
    camera, sigma = found.camera, found.sigma
    assert found.converged and error_m < 0.05
    assert abs(np.log(camera.fx / TRUE.fx)) < min(4 * sigma["focal"], 0.015)
    assert abs(camera.cx - TRUE.cx) < 4 * sigma["cx"] and abs(camera.cy - TRUE.cy) < 4 * sigma["cy"]
    assert camera.fx / camera.fy == pytest.approx(TRUE.fx / TRUE.fy)
    assert found.note(start).startswith("the calibration was refined: fx 515.2 -> ")


@pytest.mark.slow
def test_lens_coefficients_converge_from_any_start():
    ends = [refined(LENS, [0.0, 0.0, 0.0, wrong, 0.0], distortion_sigma=0.5)[2] for wrong in (0.04, 0.1)]
    found, other = (np.array(end.camera.distortion[:2]) for end in ends)
    sigma = np.array([ends[0].sigma["k1"], ends[0].sigma["k2"]])
    assert np.all(np.abs(found - LENS.distortion[:2]) < 3 * sigma) and np.all(sigma < 0.05)
    assert np.all(np.abs(found - other) < sigma)


@pytest.mark.slow
def test_a_tight_prior_holds_the_calibration():
    _, start, found = refined(TRUE, [0.03, 0.0, 0.0], focal_sigma=1e-6, centre_sigma_px=1e-3)
    assert found.camera.fx == pytest.approx(start.fx, rel=1e-4)
    assert found.sigma["focal"] <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("doubt", "told"), [(None, None), ("gain_of_pictures", -2.0), ("_is_another_lens", True)]
)
def test_a_zoom_is_found_unless_the_pictures_or_the_lens_contradict_it(doubt, told, monkeypatch):
    if doubt is not None:
        monkeypatch.setattr(intrinsics, doubt, lambda *_: told)
    _, _, found = refined(TRUE, [0.0, 0.0, 0.0], zoom=0.05)
    assert (found.changes is None) == (doubt is not None)
    if found.changes is not None:
        knots_s = np.array(found.changes.t_s)
        assert np.corrcoef(found.changes.log_ratio, np.sin(knots_s))[0, 1] > 0.9


def test_a_lens_that_is_at_no_time_the_believed_one_is_another():
    """Zoomed by a tenth from the given focal length on, or shorter than it by a quarter throughout."""
    prior = prior_about(TRUE, IntrinsicsConfig(focal_sigma=0.01))
    zoom = FocalChanges((0.0, 1.0), (-0.05, 0.05), (320.0, 240.0))
    zoomed, other = (replace(prior.mean, fx=TRUE.fx * ratio, fy=TRUE.fy * ratio) for ratio in (1.05, 0.75))
    assert not _is_another_lens(zoomed, prior, zoom)
    assert _is_another_lens(other, prior, zoom)
    breathes = replace(zoom, log_ratio=(-0.001, 0.001))
    assert _is_another_lens(zoomed, prior, breathes)
    assert not _is_another_lens(replace(zoomed, focal_changes=zoom), prior, breathes)
    assert prior.allowing(zoom).sigma[0] == pytest.approx(np.hypot(0.01, 0.05))
    assert prior.allowing(None) is prior


def test_observations_are_undistorted_by_the_new_lens():
    problem, poses, _, _ = scene(frames=12)
    made, _ = scene_of_map(map_of(problem, 0, len(poses) - 1), 0, NO_CONTROL_OBSERVATIONS)
    other = changed_camera(LENS, np.array([0.01, 2.0, 0.0, 0.02, 0.0]))
    seen = undistorted_by(other, LENS, made).observations.uv_px
    np.testing.assert_allclose(distort(other, seen), distort(LENS, made.observations.uv_px), atol=1e-6)
    np.testing.assert_allclose(undistort(other, distort(LENS, made.observations.uv_px)), seen, atol=1e-9)


def true_scene():
    problem, poses, _, _ = scene(frames=12, disturbed=0.0)
    return scene_of_map(map_of(problem, 0, len(poses) - 1), 0, NO_CONTROL_OBSERVATIONS)[0]


def test_a_centre_that_moves_far_leaves_all_observations():
    """An offset of 19 pixels is beyond the tolerance of stage D's first round, unless the poses turn."""
    before, made = changed_camera(TRUE, np.array([0.0, 8.0, -17.0])), true_scene()
    found = seen_by(before, TRUE, made)  # about what stages A to C find with a wrong centre
    assert misfit_px(found, before) < 2.0
    assert misfit_px(undistorted_by(TRUE, before, found), TRUE) > 15.0
    back = seen_by(TRUE, before, found)
    np.testing.assert_allclose(back.poses, made.poses, atol=1e-9)
    selected, _ = select_observations(back, SmoothingContext(TRUE, CONFIG), CONFIG.batch.first_tolerance)
    assert len(selected.observations.frame) == len(made.observations.frame)


@pytest.mark.slow
def test_a_pinhole_gets_radial_distortion_from_few_of_the_frames():
    """Images undistorted by a wrong lens model keep some distortion; one frame in three shows it."""
    problem, poses, _, fixes = scene(disturbed=0.0)
    made, _ = scene_of_map(map_of(problem, 0, len(poses) - 1), 0, NO_CONTROL_OBSERVATIONS)
    bent = replace(TRUE, model="opencv", distortion=(0.03, 0.0, 0.0, 0.0))
    seen = replace(made.observations, uv_px=distort(bent, made.observations.uv_px))
    frames = []

    def optimise(scene, camera, every=None, sigma=None):
        frames.append((len(scene.t_s), every))
        return optimise_batch(scene, fixes, Sensors.fixed(ANTENNA), SmoothingContext(camera, CONFIG))

    settings = IntrinsicsConfig(distortion_sigma=0.1)
    prior = prior_about(TRUE, settings)
    result, found = refine_camera(replace(made, observations=seen), TRUE, prior, optimise, settings, every=3)
    assert set(frames[:-1]) == {(20, 3)} and frames[-1] == (60, None)
    assert len(result.trajectory.t_s) == 60
    assert found.camera.distortion[0] == pytest.approx(0.03, abs=max(4 * found.sigma["k1"], 0.005))
    assert "k1 0.0000 -> 0.0" in found.note(TRUE)


@pytest.mark.slow
def test_the_rows_of_a_rolling_shutter_are_undone_for_the_calibration_alone():
    problem, poses, _, fixes = scene(disturbed=0.1)
    made, _ = scene_of_map(map_of(problem, 0, len(poses) - 1), 0, NO_CONTROL_OBSERVATIONS)
    rolling, calls = replace(TRUE, readout_s=0.03), []

    def optimise(scene, camera, every=None, sigma=None):
        calls.append((scene.observations.uv_px, camera.readout_s))
        return optimise_batch(scene, fixes, Sensors.fixed(ANTENNA), SmoothingContext(camera, CONFIG))

    settings = IntrinsicsConfig(iterations=1)
    _, found = refine_camera(made, rolling, prior_about(rolling, settings), optimise, settings)
    undone = as_global_shutter(made, rolling).observations.uv_px
    assert np.abs(undone - made.observations.uv_px).max() > 1.0
    np.testing.assert_allclose(calls[0][0], undone, atol=1e-9)
    assert [readout_s for _, readout_s in calls] == [None, None, 0.03]
    back = distort(found.camera, calls[-1][0])
    np.testing.assert_allclose(back, made.observations.uv_px, atol=1e-6)
    assert found.camera.readout_s == 0.03
