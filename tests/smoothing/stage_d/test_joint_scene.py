"""Two runs of two frames as one scene, by hand."""

from dataclasses import replace

import numpy as np
from solutions import make_gps_log

from vgps.config import Config
from vgps.gps.fixes import fixes_in_world
from vgps.gps.sensors import Sensors
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import Camera, FixClass, FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.smoothing.stage_d.joint_scene import joint_scene
from vgps.solution import Observations

WIDE = Camera(model="pinhole", width=320, height=240, fx=200.0, fy=200.0, cx=160.0, cy=120.0)
FLAT = Camera(model="pinhole", width=640, height=480, fx=400.0, fy=400.0, cx=320.0, cy=240.0)
LONG = replace(FLAT, model="opencv", distortion=(0.1, 0.0, 0.0, 0.0))


def run(camera: Camera, lever: FloatArray) -> BatchInput:
    """A camera that moves a metre east and sees a landmark; a fix half way."""
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 0, 3] = 1.0
    t_s = np.array([2.0, 3.0])
    log = make_gps_log(np.array([2.5]), (FixClass.RTK_FIX,))
    position = np.array([[0.5, 0.0, 0.0]]) + lever
    middle = np.array([[camera.cx + 40.0, camera.cy]] * 2)
    scene = Scene(
        t_s,
        poses,
        np.array([[0.0, 0.0, 5.0]]),
        Observations(np.array([0, 1]), np.array([0, 0]), middle),
        (ZeroMotion(1, 0, np.eye(4), np.ones(6)),),
    )
    return BatchInput(
        scene=scene,
        sigma_px=np.ones(1),
        control_sigma_px=np.zeros(0),
        fixes=fixes_in_world(log, position, Config().gps),
        sensors=Sensors.fixed(lever),
        fixed=None,
        context=SmoothingContext(camera, Config()),
    )


def test_worlds_clocks_cameras_and_lever_arms_become_those_of_the_first() -> None:
    east = np.eye(4)
    east[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # a quarter turn about up
    east[:3, 3] = [100.0, 0.0, 0.0]
    levers = np.array([0.1, 0.2, 0.3]), np.array([0.0, -0.5, 0.0])
    joint = joint_scene([run(WIDE, levers[0]), run(LONG, levers[1])], np.stack([np.eye(4), east]))
    assert joint.frames.tolist() == [0, 2, 4]
    assert joint.scene.observations.landmark.tolist() == [0, 0, 1, 1]
    assert joint.run.tolist() == [0, 0, 1, 1]
    np.testing.assert_allclose(joint.scene.poses[3, :3, 3], [100.0, 1.0, 0.0])
    np.testing.assert_allclose(joint.scene.points[1], [100.0, 0.0, 5.0])
    # the other camera's 40 px from the centre are 20 px for this one
    np.testing.assert_allclose(joint.scene.observations.uv_px[2], [180.0, 120.0])
    assert joint.camera.model == "pinhole" and joint.camera.fx == 200.0
    # runs follow each other with a gap that every receiver has forgotten its errors after
    np.testing.assert_allclose(np.diff(joint.scene.t_s)[[0, 2]], 1.0)
    assert np.diff(joint.scene.t_s)[1] > 1000.0
    np.testing.assert_allclose(joint.fixes.t_s, joint.scene.t_s[[0, 2]] + 0.5)
    # each fix lies where an antenna of the first run's lever arm would be
    for fix, frame in zip(joint.fixes.world_p_fix, (0, 2), strict=True):
        pose = joint.scene.poses[frame]
        half_way = 0.5 * (pose[:3, 3] + joint.scene.poses[frame + 1, :3, 3])
        np.testing.assert_allclose(fix, half_way + pose[:3, :3] @ levers[0], atol=1e-12)
    assert [(one.frame, one.reference) for one in joint.scene.zero_motions] == [(1, 0), (3, 2)]
