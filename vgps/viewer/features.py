"""What was seen in each frame, and where the map puts it."""

import numpy as np
import rerun as rr

from vgps.viewer import colours
from vgps.viewer.columns import Sheet
from vgps.viewer.measures import ReprojectedObservations
from vgps.viewer.scene import IMAGE

FEATURES, REPROJECTIONS, RESIDUALS = (
    f"{IMAGE}/{name}" for name in ("features", "reprojections", "residuals_x10")
)
MAGNIFIED = 10.0
"""The residual's line is this many times as long: errors of half a pixel would not be seen."""


def log_features(sheet: Sheet, seen: ReprojectedObservations) -> None:
    """Features in the distorted image, green to red by reprojection error, reprojections, and residuals."""
    tints = colours.green_to_red(seen.length_px, 0.0, colours.BAD_PX)
    at = np.nan_to_num(seen.seen_px, nan=-1.0).astype(np.float32)
    reprojected = np.nan_to_num(seen.reprojected_px, nan=-1.0).astype(np.float32)
    ends = np.stack([at, at + MAGNIFIED * (reprojected - at)], axis=1)
    for index, rows, lengths in sheet.chunks(seen.per_frame):
        points = rr.Points2D.columns(positions=at[rows], colors=tints[rows])
        sheet.stream.send_columns(FEATURES, index, points.partition(lengths))
        there = rr.Points2D.columns(positions=reprojected[rows])
        sheet.stream.send_columns(REPROJECTIONS, index, there.partition(lengths))
        lines = rr.LineStrips2D.columns(strips=ends[rows], colors=tints[rows])
        sheet.stream.send_columns(RESIDUALS, index, lines.partition(lengths))
    sheet.static(FEATURES, rr.Points2D.from_fields(radii=rr.Radius.ui_points(3.0), draw_order=30.0))
    sheet.static(
        REPROJECTIONS,
        rr.Points2D.from_fields(radii=rr.Radius.ui_points(1.2), colors=[colours.NOW], draw_order=31.0),
    )
    sheet.static(RESIDUALS, rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(0.8), draw_order=29.0))
