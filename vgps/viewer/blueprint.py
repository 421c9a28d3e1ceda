"""The layout of the viewer."""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from vgps.model import FloatArray
from vgps.solution import Solution
from vgps.viewer import plots
from vgps.viewer.chase_camera import CHASE, chase_scale_m
from vgps.viewer.colours import BAD_PX
from vgps.viewer.features import FEATURES, MAGNIFICATION, MOVING, REPROJECTIONS, RESIDUALS, STATIC
from vgps.viewer.geo_map import MAP
from vgps.viewer.graph import GRAPH
from vgps.viewer.run_stream import TIME
from vgps.viewer.scene import IMAGE, WORLD, extent_m
from vgps.viewer.summary import SUMMARY

_BACKGROUND = (24, 26, 32)


def blueprint(solution: Solution, has_map: bool, for_picture: bool = False) -> rrb.Blueprint:
    """Lay out video and plots on the left, scene, graph, map and verdicts on the right.

    Args:
        solution: The run; it determines the first view of the scene.
        has_map: Whether there is anything on the map.
        for_picture: Leave out the menu and the selection panel.
    """
    tabs: list[rrb.View] = [rrb.TextDocumentView(origin=SUMMARY, name="Summary")]
    if has_map:
        tabs.insert(0, rrb.MapView(origin=MAP, name="Map"))
    if solution.fixes is not None:
        tabs.insert(0, _log_view())
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_video_view(), _plot_grid(solution), row_shares=[2, 5]),
            rrb.Vertical(
                rrb.Horizontal(_scene_view(solution), _chase_view(solution), column_shares=[4, 3]),
                rrb.Horizontal(
                    rrb.GraphView(origin=GRAPH, name="Factor graph around this time, a sample"),
                    rrb.Tabs(*tabs),
                    column_shares=[1, 1],
                ),
                row_shares=[3, 2],
            ),
            column_shares=[2, 3],
        ),
        rrb.TopPanel(state="hidden" if for_picture else "expanded"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed" if for_picture else "expanded"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="paused"),
        auto_views=False,
        auto_layout=False,
    )


def _video_view() -> rrb.View:
    name = f"Reprojection error: green 0, red {BAD_PX:g} px; lines {MAGNIFICATION:g} times as long"
    return rrb.Spatial2DView(origin=IMAGE, contents="$origin/**", name=name)


def _scene_view(solution: Solution) -> rrb.View:
    eye, target = scene_viewpoint(solution)
    return _view_3d("Scene, ENU metres", eye, target, 0.05 * extent_m(solution))


def _chase_view(solution: Solution) -> rrb.View:
    return _view_3d("From behind the camera", None, None, chase_scale_m(solution.trajectory), follow=CHASE)


def _view_3d(
    name: str, eye: FloatArray | None, target: FloatArray | None, plane_m: float, follow: str | None = None
) -> rrb.View:
    hidden = [FEATURES, REPROJECTIONS, RESIDUALS, STATIC, MOVING, *([] if follow else [CHASE])]
    return rrb.Spatial3DView(
        origin=WORLD,
        contents=["+ $origin/**", *(f"- /{path}" for path in hidden)],
        name=name,
        background=_BACKGROUND,
        line_grid=False,
        overrides={IMAGE: rr.Pinhole.from_fields(image_plane_distance=plane_m)},
        eye_controls=rrb.EyeControls3D(
            position=eye,
            look_target=target,
            eye_up=(0.0, 0.0, 1.0),
            tracking_entity=f"/{follow}" if follow else None,
        ),
    )


def scene_viewpoint(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """Return the first viewpoint (3,) of the scene and the point (3,) that it looks at, metres.

    It is above and beside the path, whose longest direction runs across the picture.
    """
    centres = solution.world_T_camera[:, :3, 3]
    middle = (centres.min(axis=0) + centres.max(axis=0)) / 2.0
    flat = centres[:, :2] - centres[:, :2].mean(axis=0)
    along = np.linalg.svd(flat, full_matrices=False)[2][0]
    across = np.array([along[1], -along[0], 0.0])
    across *= -1.0 if across[1] > 0 else 1.0  # from the south rather than from the north
    span = max(2.0, float(np.ptp(flat @ along)))
    across[2] = 1.0  # as far above the path as beside it
    return middle + span * across, middle


def _plot_grid(solution: Solution) -> rrb.Container:
    axis = rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.absolute(seconds=float(solution.t_s[0])),
            end=rr.TimeRangeBoundary.absolute(seconds=float(solution.t_s[-1])),
        )
    )

    def plot(origin: str, name: str, axis_y: rrb.ScalarAxis | None = None) -> rrb.View:
        legend = rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
        return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, axis_y=axis_y, plot_legend=legend)

    views: list[rrb.View | rrb.Container] = [
        rrb.Tabs(plot(plots.ERROR, "Reprojection error [px]"), plot(plots.COUNT, "Features")),
        rrb.Tabs(
            plot(plots.SIGMA, "Std. dev. [m]"),
            plot(plots.SIGMA_ROTATION, "Std. dev. [deg]"),
        ),
        plot(plots.ENERGY, "Terms of the cost"),
    ]
    if solution.fixes is not None:
        room_for_legend = rrb.ScalarAxis(range=(0.0, 1.8 * plots.MAX_RATIO))
        views.insert(0, plot(plots.RATIO, "Fixes: residual / region", room_for_legend))
    return rrb.Grid(*views, grid_columns=2)


def _log_view() -> rrb.View:
    return rrb.TextLogView(
        origin=plots.VERDICTS,
        name="Verdicts on fixes",
        columns=rrb.TextLogColumns(
            text_log_columns=[
                rrb.encodings.TextLogColumn(kind="LogLevel"),
                rrb.encodings.TextLogColumn(kind="Body"),
            ]
        ),
    )
