"""Stage A, Kume 2010: match the followed features in a new frame and pose the camera by them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from vgps.camera import undistort
from vgps.config import MappingConfig, TrackingConfig
from vgps.geometry import project, rays
from vgps.lens_jacobian import lens_jacobian
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate
from vgps.model import BoolArray, Camera, FloatArray, Frame, GrayImage
from vgps.tracking.float_images import FloatImages
from vgps.tracking.matching import Match, Matcher, make_matcher
from vgps.tracking.moving_regions import MovingRegions
from vgps.tracking.picture_pixels import to_picture
from vgps.tracking.pose import Prediction, lmeds_pose, refine_pose
from vgps.tracking.reference_patches import ReferencePatches
from vgps.tracking.returning_features import ReturningFeatures
from vgps.tracking.row_motion import row_shifts
from vgps.tracking.static_regions import StaticRegions
from vgps.tracking.tracking_result import TrackingResult

_GUESS_ITERATIONS = 4  # for a pose that competes with others, and is refined if it wins


class FrameTracker:
    """Stage A for one camera.

    Attributes:
        static: What never moves in the picture.
        moving: What moves on its own.
    """

    def __init__(
        self, camera: Camera, tracking: TrackingConfig, mapping: MappingConfig, rng: np.random.Generator
    ) -> None:
        self._camera, self._K = camera, camera.K
        self._config, self._mapping = tracking, mapping
        self._rng = rng
        self._matcher: Matcher = make_matcher(tracking)
        self.static = StaticRegions(camera, tracking, mapping)
        self.moving = MovingRegions(camera, tracking, mapping)
        self._floats = FloatImages()
        self._patches: WeakKeyDictionary[LocalMap, ReferencePatches] = WeakKeyDictionary()
        self._returning = ReturningFeatures(camera, tracking)

    def state(self, maps: Sequence[LocalMap]) -> dict[str, Any]:
        """Return what the next frames depend on: the reference patches of maps, and what is left out."""
        patches = [(one, self._patches[one].patches) for one in maps if one in self._patches]
        regions = {"static": self.static.cells, "moving": self.moving.state(maps)}
        return {"patches": patches, "left": self._returning.state(maps), **regions}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over a state; see :meth:`state`."""
        self.static.cells = state["static"]
        self.moving.restore(state["moving"])
        for local_map, given in state["patches"]:
            self._patches[local_map] = ReferencePatches(self._camera, given)
        self._returning.restore(state["left"])

    def follow(
        self,
        local_map: LocalMap,
        previous: GrayImage,
        frame: Frame,
        view_R_frame: FloatArray | None = None,
    ) -> TrackingResult:
        """Match the features of a map that has no positions yet; the frame gets no pose.

        Args:
            local_map, previous, frame: As in :meth:`track`.
            view_R_frame: (3, 3) rotation since the newest view, if known, by which the features are searched.
        """
        raw_uv = search_uv = local_map.raw_uv_px
        if view_R_frame is not None:
            turned = np.eye(4)
            turned[:3, :3] = view_R_frame
            raw, inside = self._project(turned, rays(self._K, local_map.last_uv_px))
            search_uv = np.where(inside[:, None], raw, raw_uv)
        match = self._matcher.match(previous, frame.gray, raw_uv, search_uv)
        return self._undistorted(match).shown_by(frame.mask)

    def track(
        self, local_map: LocalMap, previous: GrayImage, frame: Frame, prediction: Prediction
    ) -> TrackingResult:
        """Match the features of a map and pose the frame, (A-2) to (A-5).

        Args:
            local_map: Features observed in ``previous``, some of them with positions.
            previous: The frame of the map's newest view.
            frame: The new frame.
            prediction: Pose by the motion model, with the gyro's rotation if there is one.

        Returns:
            Observations, and the pose unless the frame is lost.
        """
        predicted = prediction.world_T_camera
        search_uv = self._predict_pixels(local_map, predicted)
        match = self._matcher.match(previous, frame.gray, local_map.raw_uv_px, search_uv)
        first = result = self._undistorted(match).shown_by(frame.mask)
        shift = self._row_shifts(local_map, predicted)
        result = result.shifted(shift, -1.0)
        usable = local_map.positioned & result.found
        # a known rotation leaves half of the unknowns
        least = self._config.min_inliers // (2 if prediction.by_gyro else 1)
        if usable.sum() < least:
            return result.shifted(shift)
        matches = result.matches(local_map.points[local_map.ids], usable)
        by_motion, _ = refine_pose(self._K, predicted, matches, np.ones(len(matches)), _GUESS_ITERATIONS)
        guesses = np.array([by_motion, predicted, local_map.pose(int(local_map.view_frames[-1]))])
        samples, good_px = self._config.lmeds_samples, 0.4 * self._config.inlier_px
        tentative = lmeds_pose(self._K, matches, guesses, samples, self._rng, good_px)
        tentative, _ = self._refine(local_map, result, usable, tentative, prediction)
        result, shift = result.shifted(shift), self._row_shifts(local_map, tentative)
        result = result.shifted(shift, -1.0)
        aligned = self._aligned(local_map, (previous, frame), result, tentative, shift)
        matched = local_map.positioned & (result.found | aligned.found)
        min_inliers = max(least, self._config.min_inlier_share * matched.sum())
        final = self._final_pose(local_map, aligned, tentative, prediction, min_inliers)
        if final.world_T_camera is not None:
            fitting = final.found & first.found & local_map.positioned
            match = Match(first.raw_uv_px, first.found)
            self.static.observe(local_map, match, first.uv_px, fitting, final.world_T_camera)
        return final.shifted(shift)

    def find_returning(self, local_map: LocalMap, frame: Frame, result: TrackingResult) -> MapUpdate:
        """Return the features that left the picture earlier and that the newest view shows again.

        Args:
            local_map: The map with the view, before features are renewed.
            frame: The frame of its newest view.
            result: What :meth:`track` found in it; nothing is kept or searched if features gave no pose.
        """
        if not self._config.return_frames or result.pose_sigma is None:
            return MapUpdate()
        followed = self._patches[local_map]
        self._returning.keep(local_map, followed.patches.rows(np.flatnonzero(~result.found)))
        update, found = self._returning.search(local_map, self.moving.masked(frame))
        if len(found.ids):
            followed.patches = followed.patches.joined(found)
        return update

    def _row_shifts(self, local_map: LocalMap, world_T_camera: FloatArray) -> FloatArray | None:
        """Return how far a rolling shutter shifts the features (N, 2); None for a global one."""
        if not self._camera.readout_s or len(local_map.t_s) < 2:
            return None
        newest = local_map.pose(int(local_map.view_frames[-1]))  # the camera moves on as it did since
        knot_s = np.array([local_map.t_s[-2] - local_map.t_s[-1], 0.0])
        knots, points = np.stack([newest, world_T_camera]), local_map.points[local_map.ids]
        return row_shifts(self._camera, knot_s, knots, world_T_camera, points)

    def _undistorted(self, match: Match) -> TrackingResult:
        uv = undistort(self._camera, match.uv_px)
        # pixels beyond the fold of the lens's polynomial have no ray
        valid = np.asarray(np.isfinite(uv).all(axis=1))
        uv = np.where(valid[:, None], uv, 0.0)
        lens = lens_jacobian(self._camera, uv)
        return TrackingResult(raw_uv_px=match.uv_px, uv_px=uv, found=match.found & valid, lens=lens)

    def _predict_pixels(self, local_map: LocalMap, predicted: FloatArray) -> FloatArray:
        """Return where to search (N, 2) in the distorted image.

        A feature without a position is assumed at the median depth of the others.
        """
        newest = local_map.pose(int(local_map.view_frames[-1]))
        points = local_map.points[local_map.ids]
        positioned = local_map.positioned
        depths = (points[positioned] - newest[:3, 3]) @ newest[:3, 2]
        depth = float(np.median(depths)) if len(depths) else 1.0
        assumed = newest[:3, 3] + depth * rays(self._K, local_map.last_uv_px) @ newest[:3, :3].T
        raw, inside = self._project(predicted, np.where(positioned[:, None], points, assumed))
        return self.moving.predict(local_map, np.where(inside[:, None], raw, local_map.raw_uv_px))

    def _project(self, world_T_camera: FloatArray, points: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the distorted pixels (N, 2) of points (N, 3), and whether each lies in the image (N,)."""
        return to_picture(self._camera, *project(self._K, world_T_camera, points))

    def _refine(
        self,
        local_map: LocalMap,
        result: TrackingResult,
        usable: BoolArray,
        start: FloatArray,
        prediction: Prediction,
    ) -> tuple[FloatArray, FloatArray]:
        points, limit_px = local_map.points[local_map.ids], 3.0 * self._config.inlier_px
        usable = usable & result.agrees(self._K, start, points, limit_px)
        sigma = np.nan_to_num(local_map.sigma_px[local_map.ids[usable]], nan=self._mapping.sigma_floor_px)
        mu = 0.5 / np.maximum(sigma, self._mapping.sigma_floor_px) ** 2
        return refine_pose(self._K, start, result.matches(points, usable), mu, prior=prediction)

    def _aligned(
        self,
        local_map: LocalMap,
        images: tuple[GrayImage, Frame],
        result: TrackingResult,
        tentative: FloatArray,
        shift: FloatArray | None,
    ) -> TrackingResult:
        """Align the reference patches of all features of known position with a frame (A-4).

        The search begins at the first match if it agrees with the tentative pose, else at the projection.

        Args:
            local_map: As in :meth:`track`.
            images: Image of the newest view, and the new frame.
            result: The first match.
            tentative: (4, 4) pose.
            shift: From :meth:`_row_shifts`, taken from the features' pixels.
        """
        points = local_map.points[local_map.ids]
        agree = result.agrees(self._K, tentative, points, self._config.inlier_px)
        projected, inside = self._project(tentative, points)
        again = local_map.positioned & ~(result.found & agree)
        if shift is not None:
            projected = projected + shift
        start = np.where((again & inside)[:, None], projected, result.raw_uv_px)
        patches = self._patches.setdefault(local_map, ReferencePatches(self._camera))
        patches.take(local_map, self._floats.of(images[0]))
        image = self._floats.of(images[1].gray)
        aligned = patches.align(local_map, tentative, image, start, self._config.rematch_px)
        found = np.where(aligned.tried, aligned.found & (inside | ~again), result.found & ~again)
        result = self._undistorted(Match(aligned.uv_px, found)).shown_by(images[1].mask)
        return result.shifted(shift, -1.0)

    def _final_pose(
        self,
        local_map: LocalMap,
        result: TrackingResult,
        tentative: FloatArray,
        prediction: Prediction,
        min_inliers: float,
    ) -> TrackingResult:
        """Refine the pose over all inliers (A-5) by Eq. (18) and drop the matches that still disagree."""
        positioned = local_map.positioned
        usable = positioned & result.found
        points = local_map.points[local_map.ids]
        pose, information = self._refine(local_map, result, usable, tentative, prediction)
        agree = result.agrees(self._K, pose, points, self._config.inlier_px)
        inliers = int((usable & agree).sum())
        if inliers < min_inliers:
            return result
        sigma = np.sqrt(np.diag(np.linalg.pinv(information)))
        found = result.found & (agree | ~positioned)
        return replace(result, found=found, world_T_camera=pose, pose_sigma=sigma)
