"""Pieces of a scene: some of its frames, with what is seen and known there."""

from dataclasses import replace

import numpy as np

from vgps.model import IntArray
from vgps.smoothing.scene.rig_views import RigViews
from vgps.smoothing.scene.scene import Scene
from vgps.solver.integer_sets import numbered


class SceneParts:
    """The scene to cut pieces from; a piece costs what it holds, however long the scene is."""

    def __init__(self, scene: Scene) -> None:
        frame = scene.observations.frame
        self._scene = scene
        self._by_frame = None if np.all(frame[1:] >= frame[:-1]) else np.argsort(frame, kind="stable")
        self._frame = frame if self._by_frame is None else frame[self._by_frame]

    def between(self, first: int, last: int) -> tuple[Scene, IntArray]:
        """Return the frames ``first`` to ``last`` as a scene, and the landmarks (L,) that two of them see.

        Loops, the ground and known heights are left out: they tie what is far apart.
        """
        scene, frames = self._scene, slice(first, last + 1)
        rows = self._rows(first, last)
        _, landmark = numbered(scene.observations.landmark[rows])
        rows = rows[np.bincount(landmark)[landmark] > 1] if len(rows) else rows
        seen = scene.observations.rows(rows)
        ids, landmark = numbered(seen.landmark)
        held = (one for one in scene.zero_motions if first <= min(one.frame, one.reference))
        held = (one for one in held if max(one.frame, one.reference) <= last)
        rig = scene.rig
        return replace(
            scene,
            t_s=scene.t_s[frames],
            poses=scene.poses[frames],
            points=scene.points[ids],
            observations=replace(seen, frame=seen.frame - first, landmark=landmark),
            zero_motions=tuple(
                replace(one, frame=one.frame - first, reference=one.reference - first) for one in held
            ),
            controls=scene.controls.between(first, last),
            loop=None,
            rates=None if scene.rates is None else scene.rates[frames],
            ground=None,
            heights=None,
            crossing=None,
            rig=None if rig is None else RigViews(rig.camera[ids], rig.delay_s[:, frames]),
        ), ids

    def _rows(self, first: int, last: int) -> IntArray:
        """Return the observations in these frames, but those of loops."""
        begin, end = np.searchsorted(self._frame, [first, last + 1]).tolist()
        rows = np.arange(begin, end) if self._by_frame is None else self._by_frame[begin:end]
        loop = self._scene.loop
        return rows if loop is None else rows[loop[rows] < 0]
