"""Simulated recordings on disk: the files that a user has, and the exact truth."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import yaml

from vgps.camera import camera_fields
from vgps.errors import ConfigError
from vgps.model import Camera, FloatArray
from vgps.runtime.threads import map_in_order
from vgps.simulate.accelerometer import simulate_imu
from vgps.simulate.fisheye import MAX_DEG, Fisheye
from vgps.simulate.motion import Motion, MountedMotion, build_motion
from vgps.simulate.panorama import SPHERE_DEG, PanoramaRenderer, pixels_per_radian
from vgps.simulate.render import Renderer
from vgps.simulate.ring import MAX_CAMERAS, ring
from vgps.simulate.scene import SceneConfig, scene_config
from vgps.simulate.sensors import SimulatedFixes, gyro_R_camera, nmea, simulate_fixes, simulate_gyro
from vgps.simulate.street import build_world
from vgps.solution import Trajectory
from vgps.writers.atomic import new_folder
from vgps.writers.tum import write_tum

FILES = (
    *("video.mp4", "camera.yaml", "rig.yaml", "gps.nmea", "gyro.csv", "truth.tum"),
    *("fix_errors.csv", "simulation.yaml"),
)
_IMU_FILES = ("imu.csv", "imu_biases.csv")  # of scenes with an accelerometer
_BIASES_HZ = 10.0
_CAMERA_FILES = tuple(f"{name}.mp4" for name in ring(MAX_CAMERAS))
_MARK = "simulation.yaml"  # the file that marks a simulated recording
_MOTION, _WORLD, _GPS, _GYRO, _IMU = range(5)  # behind the seed: each has random numbers of its own
_NEXT_CAMERA = 7919  # between the seeds of the cameras' noise


def simulate(out: Path, scene: str | SceneConfig = "walk", seed: int = 0) -> None:
    """Write a recording with exact truth: a rendered video, camera, rig, fixes, gyro, IMU and poses.

    Args:
        out: The recording folder; an earlier simulation of that name is replaced, other files in it stay.
        scene: A name in ``SCENES``, or a scene.
        seed: Determines every random choice; the same seed gives the same bytes.

    Raises:
        ConfigError: No scene of that name, a readout longer than a frame, or too wide a fisheye.
        RunFolderError: ``out`` has other files and no earlier simulation, or cannot be written.
    """
    config = scene_config(scene) if isinstance(scene, str) else scene
    _check(config)
    own = seed if config.pass_seed is None else config.pass_seed
    with new_folder(out, (*FILES, *_IMU_FILES, *_CAMERA_FILES), _MARK) as folder:
        motion = build_motion(config, np.random.default_rng([own, _MOTION]))
        world = build_world(config, np.random.default_rng([seed, _WORLD]))
        renderer = (PanoramaRenderer if config.panorama_deg else Renderer)(world, motion, config, own)
        _write_camera(folder / "camera.yaml", config)
        _write_rig(folder / "rig.yaml", config)
        _write_sensors(folder, motion, config, own)
        t = np.arange(config.frames) / config.fps
        write_tum(Trajectory(t, motion.poses(t)), folder / "truth.tum")
        made_of = {
            "scene": scene if isinstance(scene, str) else "custom",
            "seed": seed,
            "config": repr(config),
            **({"gps_errors": config.gps.replay.source.name} if config.gps.replay else {}),
        }
        (folder / _MARK).write_text(yaml.safe_dump(made_of), encoding="utf-8")
        _write_video(folder / "video.mp4", renderer, config)
        for k, (name, mount) in enumerate(ring(config.cameras).items(), start=1):
            renderer = Renderer(world, MountedMotion(motion, mount), config, own + k * _NEXT_CAMERA)
            _write_video(folder / f"{name}.mp4", renderer, config)


def _check(config: SceneConfig) -> None:
    if not 0.0 <= config.readout_s * config.fps <= 1.0:
        raise ConfigError(
            f"a readout of {config.readout_s:g} s", expected=f"0 s to 1/{config.fps} s", place="readout_s"
        )
    if not 0.0 <= config.fisheye_deg <= MAX_DEG:
        raise ConfigError(
            f"a fisheye of {config.fisheye_deg:g} degrees",
            expected=f"0 (a pinhole) to {MAX_DEG:g}",
            place="fisheye_deg",
        )
    if config.width % 2 or config.height % 2:
        raise ConfigError(
            f"a picture of {config.width} x {config.height}",
            expected="even numbers of pixels, as H.264 has them",
            place="width, height",
        )
    if not (config.panorama_deg == 0.0 or MAX_DEG <= config.panorama_deg <= SPHERE_DEG):
        raise ConfigError(
            f"a panorama of {config.panorama_deg:g} degrees",
            expected=f"0 (none), {MAX_DEG:g} to {SPHERE_DEG:g}",
            place="panorama_deg",
        )
    if config.panorama_deg and (config.readout_s or config.fisheye_deg or config.cameras > 1):
        raise ConfigError(
            "with a readout, a fisheye or several cameras",
            expected="none of them",
            place="panorama_deg",
        )
    if config.panorama_deg == SPHERE_DEG and config.width != 2 * config.height:
        raise ConfigError(
            f"a sphere of {config.width} x {config.height}",
            expected="a picture twice as wide as high",
            place="panorama_deg",
        )


def _write_sensors(folder: Path, motion: Motion, config: SceneConfig, seed: int) -> None:
    """Write fixes, gyro and IMU, with their true errors."""
    gps_seed = seed if config.gps.seed is None else config.gps.seed
    fixes = simulate_fixes(motion, config, np.random.default_rng([gps_seed, _GPS]))
    (folder / "gps.nmea").write_bytes(nmea(fixes, config))
    _write_fix_errors(folder / "fix_errors.csv", fixes)
    gyro = simulate_gyro(motion, config, np.random.default_rng([seed, _GYRO]))
    if config.accelerometer is not None:
        rng = np.random.default_rng([seed, _IMU])
        gyro, force, bias = simulate_imu(motion, config, config.accelerometer, gyro, rng)
        _write_samples(folder / "imu.csv", gyro.t_s, np.hstack([gyro.rate_rad_s, force]))
        every = max(1, round(config.gyro.rate_hz / _BIASES_HZ))
        biases = np.hstack([gyro.bias_rad_s, bias])
        _write_samples(folder / "imu_biases.csv", gyro.t_s[::every], biases[::every])
    _write_samples(folder / "gyro.csv", gyro.t_s, gyro.rate_rad_s)


def _write_video(path: Path, renderer: Renderer | PanoramaRenderer, config: SceneConfig) -> None:
    """Render the frames and encode them as H.264, frame i at exactly ``i / fps`` seconds."""
    # neither x264's macroblock tree nor several threads reproduce the bytes
    options = {"crf": str(config.crf), "preset": "veryfast", "x264-params": "mbtree=0"}
    with av.open(path, "w") as container:
        stream = container.add_stream("libx264", rate=config.fps, options=options)
        stream.width, stream.height, stream.pix_fmt = config.width, config.height, "yuv420p"
        stream.codec_context.thread_count = 1
        stream.codec_context.time_base = Fraction(1, config.fps)
        for index, picture in enumerate(map_in_order(renderer.frame, range(config.frames))):
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = index, Fraction(1, config.fps)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def _write_camera(path: Path, config: SceneConfig) -> None:
    if config.panorama_deg == SPHERE_DEG:
        fields = {"model": "equirectangular", "width": config.width, "height": config.height}
    else:
        fields = camera_fields(_camera(config))
    path.write_text(yaml.safe_dump(fields, sort_keys=False), encoding="utf-8")


def _camera(config: SceneConfig) -> Camera:
    """Return the calibration of the scene's camera."""
    focal_px = config.focal_px
    if config.fisheye_deg:
        focal_px = Fisheye.of_diagonal(config.fisheye_deg, config.width, config.height).focal_px
    elif config.panorama_deg:
        focal_px = pixels_per_radian(config)
    pinhole = not (config.fisheye_deg or config.panorama_deg)
    return Camera(
        model="pinhole" if pinhole else "fisheye",
        width=config.width,
        height=config.height,
        fx=focal_px,
        fy=focal_px,
        cx=(config.width - 1) / 2,
        cy=(config.height - 1) / 2,
        distortion=() if pinhole else (0.0,) * 4,
        readout_s=config.readout_s,
    )


def _write_rig(path: Path, config: SceneConfig) -> None:
    fields = {
        "camera_p_antenna": list(config.camera_p_antenna),
        "video_start_utc": config.start_utc,
        "world_origin": list(config.world_origin),
        "gyro_R_camera": np.round(gyro_R_camera(config.gyro), 12).tolist(),
        "exposure_s": config.exposure_s,
    }
    if config.accelerometer is not None:
        fields["imu_R_camera"] = np.round(gyro_R_camera(config.gyro), 12).tolist()
        fields["imu_p_camera"] = list(config.accelerometer.imu_p_camera)
    if config.cameras > 1:
        fields["cameras"] = [
            {
                "name": name,
                "video": f"{name}.mp4",
                "reference_R_camera": (np.round(mount[:3, :3], 12) + 0.0).tolist(),
                "reference_p_camera": np.round(mount[:3, 3], 12).tolist(),
            }
            for name, mount in ring(config.cameras).items()
        ]
    path.write_text(yaml.safe_dump(fields, sort_keys=False), encoding="utf-8")


def _write_samples(path: Path, t_s: FloatArray, values: FloatArray) -> None:
    """Write rates, and specific force if there are six columns."""
    columns = ("wx_rad_s", "wy_rad_s", "wz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")
    head = ",".join(("t_s", *columns[: values.shape[1]]))
    np.savetxt(path, np.column_stack([t_s, values]), "%.6f", ",", header=head, comments="", encoding="utf-8")


def _write_fix_errors(path: Path, fixes: SimulatedFixes) -> None:
    lines = ["t_s,fix_class,east_m,north_m,up_m,outlier"]
    for t, fix_class, error, outlier in zip(
        fixes.t_s, fixes.fix_class, fixes.error_m, fixes.outlier, strict=True
    ):
        lines.append(f"{t:.2f},{fix_class},{error[0]:.4f},{error[1]:.4f},{error[2]:.4f},{int(outlier)}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
