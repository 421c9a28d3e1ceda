"""``camera.yaml`` of a run is read back as its camera, and only a run that found one has it."""

from dataclasses import replace

from vgps.readers.calibration.camera_file import read_camera
from vgps.writers.camera import write_camera
from vgps.writers.run_folder import write_run


def test_a_found_camera_is_read_back(solution, tmp_path):
    lens = replace(
        solution.camera, model="fisheye", pixel_mm=None, distortion=(0.05, -0.01, 0.0, 0.0), readout_s=0.02
    )
    sensors = replace(solution.sensors, camera_sigma={"focal": 0.01, "k1": 0.002})
    found = replace(solution, camera=lens, sensors=sensors, camera_source="a wide lens")
    write_camera(found, tmp_path / "camera.yaml")
    assert read_camera(tmp_path / "camera.yaml") == lens
    head = (tmp_path / "camera.yaml").read_text().splitlines()[0]
    assert head.startswith("# found by vgps from the video itself") and "focal 0.01, k1 0.002" in head


def test_a_run_with_a_given_camera_has_none(solution, tmp_path):
    found = replace(solution, sensors=replace(solution.sensors, camera_sigma={"focal": 0.01}))
    write_run(found, tmp_path / "run")
    assert (tmp_path / "run/camera.yaml").is_file()
    given = replace(solution, sensors=replace(solution.sensors, camera_sigma={}))
    write_run(given, tmp_path / "run")
    assert not (tmp_path / "run/camera.yaml").exists()
