"""A scene for Gaussian splatting: undistorted images, a COLMAP model near the origin, and the way back.

Trainers want pinhole images and coordinates near zero, and many normalise the scene; ``georeference.json``
says where the scene's origin is, so that a result keeps its place and scale.
"""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from vgps.camera import distort
from vgps.crs import ELLIPSOIDAL
from vgps.crs.frames import local_R_world
from vgps.geodesy import to_geodetic
from vgps.model import Camera, FloatArray, GeodeticPoint, RgbImage
from vgps.solution import Solution
from vgps.writers.colmap import write_colmap
from vgps.writers.export_job import ExportJob
from vgps.writers.jpeg import encoded
from vgps.writers.nerfstudio import write_nerfstudio

MARK = "georeference.json"  # the file that marks a scene written by vgps
FILES = ("images", "sparse", "transforms.json", "README.md", MARK)
_README = """# Scene for Gaussian splatting

- `images/`: {images} undistorted pinhole images
- `sparse/0/`: their COLMAP model, whose points start the training
- `transforms.json`: the same cameras for Instant NGP and nerfstudio
- `georeference.json`: {where}

Units are metres, axes east, north, up. Train without turning, shifting or scaling the scene:

nerfstudio:

    ns-train splatfacto --data . colmap --colmap-path sparse/0 --images-path images --downscale-factor 1 \\
      --orientation-method none --center-method none --auto-scale-poses False

gsplat:

    python examples/simple_trainer.py default --data_dir . --data_factor 1 --no-normalize-world-space

The original 3DGS:

    python train.py -s .
"""


def write_splat(job: ExportJob, folder: Path) -> None:
    """Write the scene: images, model, cameras, georeference and a recipe.

    Raises:
        RunFolderError: There are no frames where the run says.
    """
    camera = job.solution.camera
    (folder / "images").mkdir()
    (folder / "sparse" / "0").mkdir(parents=True)
    lens = None if camera.model == "pinhole" else _lens_map(camera)
    written = []
    for row, picture in job.pictures():
        name = job.jpeg_names[row]
        (folder / "images" / name).write_bytes(encoded(Image.fromarray(_undistorted(picture, lens))))
        written.append(name)
    scene, world_p_origin = _near_origin(job.solution)
    write_colmap(scene, folder / "sparse" / "0", job.jpeg_names)
    write_nerfstudio(scene, folder / "transforms.json", job.jpeg_names)
    about = _georeference(job, scene, world_p_origin)
    (folder / MARK).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    where = (
        "the place of the scene's origin" if job.system else "the run has no place: its scale is arbitrary"
    )
    (folder / "README.md").write_text(_README.format(images=len(written), where=where), encoding="utf-8")


def _near_origin(solution: Solution) -> tuple[Solution, FloatArray]:
    """Return the run as the scene has it, and the scene's origin (3,) in the run's world.

    The scene is in east, north, up at its own origin, the mean of the cameras; the camera is a pinhole.
    """
    world_p_origin = np.round(solution.world_T_camera[:, :3, 3].mean(axis=0), 3)
    scene_T_world, centre = np.eye(4), None
    if solution.world_origin is not None:
        centre = GeodeticPoint(*map(float, to_geodetic(solution.world_origin, world_p_origin)))
        scene_T_world[:3, :3] = local_R_world(solution.world_origin, np.array([centre]))[0]
    scene_T_world[:3, 3] = -scene_T_world[:3, :3] @ world_p_origin
    points = solution.landmarks.world_p_landmark @ scene_T_world[:3, :3].T + scene_T_world[:3, 3]
    scene = replace(
        solution,
        world_T_camera=scene_T_world @ solution.world_T_camera,
        camera=replace(solution.camera, model="pinhole", distortion=(), pixel_mm=None, focal_changes=None),
        landmarks=replace(solution.landmarks, world_p_landmark=points),
        world_origin=centre,
    )
    return scene, world_p_origin


def _georeference(job: ExportJob, scene: Solution, world_p_origin: FloatArray) -> dict[str, object]:
    """Return where the scene is: its origin in WGS 84, in the run's world, and in the system asked for."""
    centre, system = scene.world_origin, job.system
    about: dict[str, object] = {
        "schema_version": 1,
        "georeferenced": scene.georeferenced,
        "axes": "east, north, up at world_origin; metres",
        "world_origin": None if centre is None else centre._asdict(),
        "height_datum": ELLIPSOIDAL,
        "run_p_scene_origin_m": world_p_origin.tolist(),
    }
    if system is not None and centre is not None:
        coordinates = system.from_geodetic(np.array([centre]))[0].tolist()
        about["in_crs"] = {
            "crs": system.name,
            "height_datum": system.height_datum,
            **dict(zip(system.axes, coordinates, strict=True)),
        }
    return about


def _lens_map(camera: Camera) -> FloatArray:
    """Return (H, W, 2) the pixel of the original image of every pixel of the pinhole image; -1 outside."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    source = distort(camera, np.column_stack([u.ravel(), v.ravel()]))
    source[~np.isfinite(source).all(axis=1)] = -1.0
    return source.reshape(camera.height, camera.width, 2)


def _undistorted(picture: RgbImage, lens: FloatArray | None) -> RgbImage:
    if lens is None:
        return picture
    u, v = np.moveaxis(lens.astype(np.float32), -1, 0)
    return np.asarray(cv2.remap(picture, u, v, cv2.INTER_LINEAR), np.uint8)
