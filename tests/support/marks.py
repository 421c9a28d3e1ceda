"""Marks on the walls of a simulated world: exact positions, and where the true cameras see them."""

import numpy as np

from vgps.camera import project
from vgps.geodesy import to_geodetic
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory


def write_marks(recording, out, count=30, control=0, noise_px=0.3, sigma_m=0.0, seed=0):
    """Write ``control_points.csv`` of marks ahead of the path; return their true positions (count, 3)."""
    rng = np.random.default_rng(seed)
    opened, truth = open_recording(recording), read_trajectory(recording / "truth.tum")
    camera, poses = opened.camera, truth.world_T_camera
    marks, rows = [], []
    while len(marks) < count:
        # 6 to 15 m ahead of some camera, in its image
        pose = poses[rng.integers(len(poses))]
        uv = rng.uniform([0.15, 0.15], [0.85, 0.85]) * [camera.width, camera.height]
        ray = np.array([(uv[0] - camera.cx) / camera.fx, (uv[1] - camera.cy) / camera.fy, 1.0])
        place = pose[:3, :3] @ (ray * rng.uniform(6, 15)) + pose[:3, 3]
        p = np.einsum("fji,fj->fi", poses[:, :3, :3], place - poses[:, :3, 3])
        seen = project(camera, p) + rng.normal(0, noise_px, (len(poses), 2))
        inside = (p[:, 2] > 2.0) & ((seen > 5) & (seen < [camera.width - 5, camera.height - 5])).all(axis=1)
        frames = np.flatnonzero(inside)[:: max(1, inside.sum() // 5)]
        if len(frames) < 3:
            continue
        surveyed = to_geodetic(opened.rig.world_origin, place + rng.normal(0, sigma_m, 3) * (sigma_m > 0))
        role = "control" if len(marks) < control else "check"
        where = f"{surveyed[0]:.10f},{surveyed[1]:.10f},{surveyed[2]:.5f}"
        rows += [f"M{len(marks)},{role},{f},{seen[f, 0]},{seen[f, 1]},{where},{sigma_m}" for f in frames]
        marks.append(place)
    header = "name,role,frame,u_px,v_px,latitude_deg,longitude_deg,height_m,sigma_east_m"
    out.write_text("\n".join([header, *rows]) + "\n")
    return np.array(marks)
