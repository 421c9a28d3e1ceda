"""How the viewer is laid out."""

import numpy as np
import rerun.blueprint as rrb

from vgps.model import FloatArray
from vgps.solution import Solution
from vgps.viewer import plots
from vgps.viewer.colours import BAD_PX
from vgps.viewer.features import FEATURES, REPROJECTIONS, RESIDUALS
from vgps.viewer.graph import GRAPH
from vgps.viewer.places import MAP
from vgps.viewer.scene import IMAGE, WORLD
from vgps.viewer.sheet import TIME

_BACKGROUND = (24, 26, 32)


def blueprint(solution: Solution, has_map: bool) -> rrb.Blueprint:
    """Video and plots on the left, scene, graph, map and verdicts on the right.

    Args:
        solution: The run; it says from where the scene is seen at first.
        has_map: Whether there is anything on the map.
    """
    has_fixes = solution.fixes is not None
    tabs: list[rrb.View] = [_text_view(plots.SUMMARY, "Summary")]
    if has_map:
        tabs.insert(0, rrb.MapView(origin=MAP, name="Map"))
    if has_fixes:
        tabs.insert(0, rrb.TextLogView(origin=plots.VERDICTS, name="Verdicts on fixes"))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_video_view(), _plot_grid(has_fixes), row_shares=[2, 5]),
            rrb.Vertical(
                _scene_view(solution),
                rrb.Horizontal(
                    rrb.GraphView(origin=GRAPH, name="Factor graph (a sample)"),
                    rrb.Tabs(*tabs),
                    column_shares=[3, 2],
                ),
                row_shares=[3, 2],
            ),
            column_shares=[9, 11],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="paused"),
        auto_views=False,
        auto_layout=False,
    )


def _video_view() -> rrb.View:
    name = f"Features: green 0 px, red {BAD_PX:g} px of reprojection error; lines ten times as long"
    return rrb.Spatial2DView(origin=IMAGE, contents="$origin/**", name=name)


def _scene_view(solution: Solution) -> rrb.View:
    hidden = [f"- /{path}" for path in (FEATURES, REPROJECTIONS, RESIDUALS)]
    eye, target = eye_above(solution)
    return rrb.Spatial3DView(
        origin=WORLD,
        contents=["+ $origin/**", *hidden],
        name="Scene, ENU metres",
        background=_BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0)),
    )


def eye_above(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """Where the scene is first seen from, and which point is in the middle: (3,) and (3,), metres."""
    centres = solution.world_T_camera[:, :3, 3]
    low, high = centres.min(axis=0), centres.max(axis=0)
    span = max(2.0, float(np.linalg.norm(high - low)))
    middle = (low + high) / 2.0
    return middle + span * np.array([0.15, -0.62, 0.5]), middle


def _plot_grid(has_fixes: bool) -> rrb.Container:
    views = [
        _plot(plots.ERROR, "Reprojection error of a frame [px]"),
        _plot(plots.COUNT, "Features of a frame"),
        _plot(plots.SIGMA, "Standard deviation of the position [m]"),
        _plot(plots.SIGMA_ROTATION, "Standard deviation of the rotation [deg]"),
        _plot(plots.ENERGY, "Terms of the energy, Eq. (11)"),
    ]
    if has_fixes:
        views.insert(0, _plot(plots.RATIO, "Residual of a fix over its region"))
    return rrb.Grid(*views, grid_columns=2)


def _plot(origin: str, name: str) -> rrb.View:
    return rrb.TimeSeriesView(
        origin=origin, name=name, plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
    )


def _text_view(origin: str, name: str) -> rrb.View:
    return rrb.TextDocumentView(origin=origin, name=name)
