import numpy as np
import pytest

from vgps.config import Config
from vgps.errors import ConfigError
from vgps.model import Camera, ImuMount, Recording, Rig, RigCamera
from vgps.pipeline.rig_recordings import check_settings, seen_by, settings_for

LENS = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=500.0, cx=319.5, cy=239.5)
REAR = np.array(
    [[-1.0, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, -1, -0.5], [0, 0, 0, 1]]
)  # looks back from 0.5 m behind


def camera(pose: np.ndarray) -> RigCamera:
    return RigCamera(name="rear", video=None, camera=LENS, reference_T_camera=pose, sigma=np.zeros(6))  # type: ignore[arg-type]


def test_the_sensors_keep_their_places_on_the_rig() -> None:
    mount = ImuMount(imu_R_camera=np.eye(3), imu_p_camera=np.array([0.0, 0.2, 0.0]))
    rig = Rig(camera_p_antenna=np.array([0.3, -1.0, 0.0]), gyro_R_camera=np.eye(3), imu=mount)
    recording = Recording(path=None, video=None, camera=LENS, rig=rig, cameras=(camera(REAR),))  # type: ignore[arg-type]
    seen = seen_by(recording.cameras[0], recording)
    # the antenna is 0.2 m to the right of the rear camera's centre seen from the front, so to its left, and
    # 0.5 m ahead of it, so behind it
    np.testing.assert_allclose(seen.rig.camera_p_antenna, [-0.2, -1.0, -0.5])
    np.testing.assert_allclose(seen.rig.gyro_R_camera, REAR[:3, :3])
    assert seen.rig.imu is not None
    np.testing.assert_allclose(seen.rig.imu.imu_p_camera, [0.1, 0.2, -0.5])
    assert seen.cameras == ()


def test_a_camera_is_level_only_as_far_as_it_stands_upright() -> None:
    start = Config().start
    assert settings_for(camera(REAR), Config()).start == start
    rolled = np.eye(4)
    rolled[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    assert settings_for(camera(rolled), Config()).start.level_sigma_deg == pytest.approx(
        np.hypot(start.level_sigma_deg, 90.0)
    )


@pytest.mark.parametrize(
    "setting", [{"intrinsics": {"refine": "yes"}}, {"rolling_shutter": {"estimate": "yes"}}]
)
def test_what_a_rig_does_not_support_is_refused(setting) -> None:
    check_settings(Config())
    with pytest.raises(ConfigError, match="with a rig of several cameras"):
        check_settings(Config.model_validate(setting))
