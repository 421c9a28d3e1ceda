"""Scenes without the frames of stops: those have no observations, and would only be more unknowns."""

from dataclasses import replace

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.smoothing.scene.scene import Scene


def without_stops(scene: Scene) -> tuple[Scene, IntArray]:
    """Return a scene without the frames that stand, and the rows (n,) of those that are left.

    The last frame of each stop stays, so that what is measured during a stop is where the camera stood, and
    with it frames that show control points.
    """
    stands = np.zeros(len(scene.t_s), dtype=bool)
    stands[[one.frame for one in scene.zero_motions]] = True
    stands[:-1] &= stands[1:]
    stands[-1:] = False
    stands[scene.controls.frame] = False
    if not stands.any():
        return scene, np.arange(len(stands))
    row_of = np.where(stands, -1, np.cumsum(~stands) - 1)
    observations, controls = scene.observations, scene.controls
    moving = replace(
        scene,
        t_s=scene.t_s[~stands],
        poses=scene.poses[~stands],
        observations=replace(observations, frame=row_of[observations.frame]),
        controls=replace(controls, frame=row_of[controls.frame]),
        zero_motions=tuple(
            replace(one, frame=int(row_of[one.frame]), reference=int(row_of[one.reference]))
            for one in scene.zero_motions
            if not stands[one.frame]
        ),
    )
    return moving, np.flatnonzero(~stands)


def with_stops(scene: Scene, rows: IntArray, poses: FloatArray) -> FloatArray:
    """Return the poses (F, 4, 4) of all frames of a scene from those (n, 4, 4) of ``rows``.

    A frame that stands is where it stood, by its constraint.
    """
    out = scene.poses.copy()
    out[rows] = poses
    others = set(range(len(out))).difference(rows.tolist())
    for one in scene.zero_motions:
        if one.frame in others:
            out[one.frame] = out[one.reference] @ one.reference_T_frame
    return out
