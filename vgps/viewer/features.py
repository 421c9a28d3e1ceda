"""Features observed in each frame, the reprojections of their landmarks, and what was left out."""

import numpy as np
import rerun as rr

from vgps.solution import Solution
from vgps.viewer import colours
from vgps.viewer.residuals import ReprojectedObservations
from vgps.viewer.run_stream import RunStream
from vgps.viewer.scene import IMAGE

FEATURES, REPROJECTIONS, RESIDUALS = (
    f"{IMAGE}/{name}" for name in ("features", "reprojections", "residuals_x10")
)
STATIC, MOVING = f"{IMAGE}/static_regions", f"{IMAGE}/moving_regions"
MAGNIFICATION = 10.0
"""Factor by which residuals are drawn longer: errors of half a pixel would be invisible."""


def log_features(stream: RunStream, observations: ReprojectedObservations) -> None:
    """Log features in the distorted image, coloured by reprojection error, reprojections and residuals."""
    tints = colours.green_to_red(observations.length_px, 0.0, colours.BAD_PX)
    observed = np.nan_to_num(observations.observed_px, nan=-1.0).astype(np.float32)
    reprojected = np.nan_to_num(observations.reprojected_px, nan=-1.0).astype(np.float32)
    lines = np.stack([observed, observed + MAGNIFICATION * (reprojected - observed)], axis=1)
    per_frame = observations.per_frame
    stream.send_batches(
        FEATURES, per_frame, lambda rows: rr.Points2D.columns(positions=observed[rows], colors=tints[rows])
    )
    stream.send_batches(
        REPROJECTIONS, per_frame, lambda rows: rr.Points2D.columns(positions=reprojected[rows])
    )
    stream.send_batches(
        RESIDUALS, per_frame, lambda rows: rr.LineStrips2D.columns(strips=lines[rows], colors=tints[rows])
    )
    stream.log_static(FEATURES, rr.Points2D.from_fields(radii=rr.Radius.ui_points(3.0), draw_order=30.0))
    stream.log_static(
        REPROJECTIONS,
        rr.Points2D.from_fields(radii=rr.Radius.ui_points(1.2), colors=[colours.NOW], draw_order=31.0),
    )
    stream.log_static(RESIDUALS, rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.8), draw_order=29.0))


def log_left_out(stream: RunStream, solution: Solution) -> None:
    """Log rectangles around what never moves, and what moves on its own, whenever they change."""
    for entity, regions, colour in (
        (STATIC, solution.static_regions, colours.REJECTED),
        (MOVING, solution.moving_regions, colours.MOVING),
    ):
        first, last, *_ = regions.T
        for frame in np.unique(np.concatenate([first, last + 1])).tolist():
            now = regions[(first <= frame) & (frame <= last)]
            if frame < len(stream.t_s):
                boxes = rr.Boxes2D(array=now[:, 2:], array_format=rr.Box2DFormat.XYXY, colors=[colour])
                stream.log_from_frame(entity, frame, boxes)
