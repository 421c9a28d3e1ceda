"""The 3-D scene: camera, path, landmarks, and every fix with its cylinder at true size."""

import itertools

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.solution import FrameState, Solution, Verdict
from vgps.viewer import colours
from vgps.viewer.columns import Sheet
from vgps.viewer.descriptions import fix_title
from vgps.viewer.measures import judged

WORLD, CAMERA, IMAGE = "world", "world/camera", "world/camera/image"
PATH, BEFORE, LANDMARKS, FIXES, NOW = (
    "world/path",
    "world/path_before_d",
    "world/landmarks",
    "world/fixes",
    "world/fix_now",
)
_SEEN_THROUGH = 45  # alpha of a cylinder: the path and its neighbours must be seen through it


def log_scene(sheet: Sheet, solution: Solution) -> None:
    """Everything that has a place in the world, ENU metres."""
    sheet.static(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_camera(sheet, solution)
    _log_paths(sheet, solution)
    landmarks = solution.landmarks
    sheet.static(
        LANDMARKS,
        rr.Points3D(
            landmarks.world_p_landmark,
            colors=colours.green_to_red(landmarks.sigma_px, colours.GOOD_SIGMA_PX, colours.BAD_SIGMA_PX),
            radii=rr.Radius.ui_points(1.2),
        ),
        rr.AnyValues(sigma_px=landmarks.sigma_px),
    )
    if solution.fixes is not None and solution.gps is not None:
        for fix_class, verdict, rows in fix_groups(solution):
            _log_fixes(sheet, solution, fix_class, verdict, rows)
        _log_fix_now(sheet, solution)


def fix_groups(solution: Solution) -> list[tuple[FixClass, Verdict, IntArray]]:
    """The rows of the fixes with a position, by class and verdict, classes from best to worst."""
    table, log = solution.fixes, solution.gps
    if table is None or log is None:
        return []
    placed = np.isfinite(table.world_p_fix).all(axis=1)
    groups = []
    for fix_class in FixClass:
        for verdict in Verdict:
            alike: BoolArray = np.array(
                [pair == (fix_class, verdict) for pair in zip(log.fix_class, table.verdict, strict=True)],
                bool,
            )
            rows = np.flatnonzero(alike & placed)
            if len(rows):
                groups.append((fix_class, verdict, rows))
    return groups


def fixes_path(fix_class: FixClass, verdict: Verdict) -> str:
    """Where the fixes of a class and verdict are logged."""
    return f"{FIXES}/{fix_class}/{verdict.name.lower()}"


def extent_m(solution: Solution) -> float:
    """The longer side of the box around the camera's path, at least 1 m."""
    return max(1.0, float(np.ptp(solution.world_T_camera[:, :3, 3], axis=0).max()))


def _log_camera(sheet: Sheet, solution: Solution) -> None:
    poses, camera = solution.world_T_camera, solution.camera
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    sheet.at_frames(CAMERA, rr.Transform3D.columns(translation=poses[:, :3, 3], quaternion=quaternions))
    sheet.static(
        IMAGE,
        rr.Pinhole(
            image_from_camera=camera.K,
            resolution=(camera.width, camera.height),
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=0.05 * extent_m(solution),
            color=colours.NOW,
        ),
    )


def _log_paths(sheet: Sheet, solution: Solution) -> None:
    centres = solution.world_T_camera[:, :3, 3]
    bridged = np.array([state is FrameState.BRIDGED for state in solution.state], bool)
    strips = _runs(centres, bridged)
    sheet.static(
        PATH,
        rr.LineStrips3D(
            [strip for strip, _ in strips],
            colors=[colours.BRIDGED if gap else colours.PATH for _, gap in strips],
            radii=rr.Radius.ui_points(2.0),
        ),
    )
    if solution.world_p_before is not None:
        sheet.static(
            BEFORE,
            rr.LineStrips3D(
                [solution.world_p_before], colors=[colours.BEFORE], radii=rr.Radius.ui_points(1.2)
            ),
        )


def _runs(centres: FloatArray, bridged: BoolArray) -> list[tuple[FloatArray, bool]]:
    """The path cut where its state changes; a piece ends where the next one begins."""
    cuts = [0, *(np.flatnonzero(np.diff(bridged)) + 1).tolist(), len(centres)]
    return [(centres[first : last + 1], bool(bridged[first])) for first, last in itertools.pairwise(cuts)]


def _log_fixes(
    sheet: Sheet, solution: Solution, fix_class: FixClass, verdict: Verdict, rows: IntArray
) -> None:
    _, table = judged(solution)
    path, colour = fixes_path(fix_class, verdict), colours.of_fix(fix_class, verdict)
    sheet.static(
        path,
        rr.Points3D(
            table.world_p_fix[rows],
            colors=[colour],
            radii=rr.Radius.ui_points(3.5),
            labels=[fix_title(solution, int(row)) for row in rows],
            show_labels=False,
        ),
        rr.AnyValues(verdict=[table.reason[row] for row in rows]),
    )
    sized = rows[np.isfinite(table.r_m[rows]) & np.isfinite(table.h_m[rows])]
    if len(sized):
        sheet.static(
            f"{path}/region",
            rr.Cylinders3D(
                centers=table.world_p_fix[sized],
                radii=table.r_m[sized],
                lengths=2.0 * table.h_m[sized],  # h is half the height, Eq. (16)
                colors=[colours.faint(colour, _SEEN_THROUGH)],
                fill_mode="solid",
                labels=[fix_title(solution, int(row)) for row in sized],
                show_labels=False,
            ),
        )
    reached = rows[np.isfinite(table.residual_m[rows]).all(axis=1)]
    if len(reached):
        fix = table.world_p_fix[reached]
        lines = np.stack([fix, fix + table.residual_m[reached]], axis=1)
        sheet.static(
            f"{path}/residual",
            rr.LineStrips3D(list(lines), colors=[colour], radii=rr.Radius.ui_points(1.0)),
        )


def _log_fix_now(sheet: Sheet, solution: Solution) -> None:
    """The region of the last fix before the time that is shown, as a white frame."""
    _, table = judged(solution)
    rows = np.flatnonzero(np.isfinite(table.world_p_fix).all(axis=1) & np.isfinite(table.r_m + table.h_m))
    if len(rows):
        sheet.at_times(
            NOW,
            solution.fix_times_s[rows],
            rr.Cylinders3D.columns(
                centers=table.world_p_fix[rows], radii=table.r_m[rows], lengths=2.0 * table.h_m[rows]
            ),
        )
        sheet.static(NOW, rr.Cylinders3D.from_fields(colors=[colours.NOW], fill_mode="majorwireframe"))
