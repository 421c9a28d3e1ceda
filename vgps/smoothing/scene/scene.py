"""What stages C and D optimise: frames, features, observations and constraints, as plain data."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.smoothing.scene.ground import Ground
from vgps.smoothing.scene.height_ties import HeightTies
from vgps.smoothing.scene.rig_views import RigViews
from vgps.solution import Observations, Trajectory
from vgps.solver.disk_arrays import DiskArrays
from vgps.solver.equations.landmark_groups import track_ends
from vgps.solver.integer_sets import numbered

MIN_LANDMARKS = 3
"""Landmarks that determine a pose."""
_MANY = 10**6  # tracks


@dataclass(frozen=True)
class Scene:
    """Input of stages C and D: frames with times and poses, features, observations and constraints.

    Attributes:
        t_s: (F,) times of the frames.
        poses: (F, 4, 4) world_T_camera.
        points: (L, 3) positions of the features.
        observations: Observations of these features in these frames.
        zero_motions: Zero-motion constraints; frames counted from the first of the scene.
        controls: Observations of control points.
        loop: (N,) number of the loop by which a landmark of an earlier visit was found in a frame, -1 for
            observations of a track; None without loops.
        rates: (F, 3) angular rates of the frames beyond the path of a rolling shutter, rad/s; None for none.
        ground: The ground under the path; None if it is not known.
        heights: Stretches of known length by the camera's height above the ground; None without.
        rig: Which camera observes each feature, if there are several; the poses are those of the first.
        crossing: (F - 1,) the crossing tracks of the scene that this one has few frames of; else None.
    """

    t_s: FloatArray
    poses: FloatArray
    points: FloatArray
    observations: Observations
    zero_motions: tuple[ZeroMotion, ...] = ()
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS
    loop: IntArray | None = None
    rates: FloatArray | None = None
    ground: Ground | None = None
    heights: HeightTies | None = None
    rig: RigViews | None = None
    crossing: IntArray | None = None

    @property
    def trajectory(self) -> Trajectory:
        """Poses of the frames over time."""
        return Trajectory(self.t_s, self.poses)

    @property
    def unseen(self) -> BoolArray:
        """(F,) frames with too few observations for a pose that no zero motion holds."""
        return self.hardly_seen(MIN_LANDMARKS)

    def hardly_seen(self, fewest: int) -> BoolArray:
        """Return the frames (F,) with fewer observations than that, which no zero motion holds."""
        few = np.bincount(self.observations.frame, minlength=len(self.t_s)) < fewest
        few[[constraint.frame for constraint in self.zero_motions]] = False
        return np.asarray(few)

    def torn(self, fewest: int) -> BoolArray:
        """Return the places (F - 1,) between successive frames that fewer tracks cross."""
        return np.asarray(self.crossing_tracks() < fewest)

    def crossing_tracks(self) -> IntArray:
        """Return the number (F - 1,) of tracks that were seen before and after each place between frames.

        A zero motion counts as many. Loops do not count: they tie what is far apart in time.
        """
        if self.crossing is not None:
            return self.crossing
        frame, landmark = self.observations.frame, self.observations.landmark
        if self.loop is not None:
            frame, landmark = frame[self.loop < 0], landmark[self.loop < 0]
        first, last = track_ends(frame, landmark, len(self.points))
        stands = [sorted((held.reference, held.frame)) for held in self.zero_motions]
        held = np.array(stands, dtype=np.int64).reshape(-1, 2).T
        begin, end = (
            np.bincount(tracks[first < last], minlength=len(self.t_s))
            + _MANY * np.bincount(stand, minlength=len(self.t_s))
            for tracks, stand in zip((first, last), held, strict=True)
        )
        return np.cumsum(begin - end)[:-1]

    def with_observations(self, kept: BoolArray) -> "Scene":
        """Return the scene with some of its observations (N,)."""
        loop = None if self.loop is None else self.loop[kept]
        return replace(self, observations=self.observations.rows(kept), loop=loop)

    def on_disk(self) -> "Scene":
        """Return the scene with its observations on disk."""
        kept, seen = DiskArrays().kept, self.observations
        observations = Observations(kept(seen.frame), kept(seen.landmark), kept(seen.uv_px))
        return replace(self, observations=observations)


def scene_of_map(local_map: LocalMap, first: int, controls: ControlObservations) -> tuple[Scene, IntArray]:
    """Return the frames of a map from ``first`` on as a scene, and the feature ids (L,) of its points.

    Args:
        local_map: Map, all frames posed.
        first: Index of the first frame.
        controls: Observations of control points in all frames.
    """
    log = local_map.observations(first)
    known = np.isfinite(local_map.points[log.landmark, 0])
    known &= np.isfinite(local_map.poses[log.frame - local_map.first_frame, 0, 0])
    ids, row = numbered(log.landmark[known])
    observations = Observations(log.frame[known] - first, row, log.uv_px[known])
    constraints = tuple(
        ZeroMotion(held.frame - first, held.reference - first, held.reference_T_frame, held.sigma)
        for held in local_map.zero_motions
        if held.reference >= first
    )
    rows = slice(first - local_map.first_frame, None)
    poses = local_map.poses[rows]
    known_points = controls.between(first, first + len(poses) - 1)
    return Scene(
        local_map.t_s[rows], poses, local_map.points[ids], observations, constraints, known_points
    ), ids
