"""The 3-D scene: camera, path, landmarks, and every fix with its region at true size."""

import itertools

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.solution import FixTable, FrameState, Landmarks, Solution, Verdict
from vgps.viewer import colours
from vgps.viewer.residuals import gps_results
from vgps.viewer.run_stream import RunStream
from vgps.viewer.selection_details import fix_title

WORLD, CAMERA, IMAGE = "world", "world/camera", "world/camera/image"
PATH, BEFORE, LANDMARKS, FIXES, NOW = (
    "world/path",
    "world/path_before_d",
    "world/landmarks",
    "world/fixes",
    "world/fix_now",
)
_REGION_ALPHA = 45  # the path and other regions must be visible through a region


def log_scene(stream: RunStream, solution: Solution) -> None:
    """Log everything that has a position in the world, ENU metres."""
    stream.log_static(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_camera(stream, solution)
    _log_paths(stream, solution)
    _log_landmarks(stream, LANDMARKS, solution.landmarks)
    for camera in solution.cameras:
        _log_landmarks(stream, f"{LANDMARKS}_{camera.name}", camera.landmarks)
    for fix_class, verdict, rows in fix_groups(solution):
        _log_fixes(stream, solution, fix_class, verdict, rows)
    if solution.fixes is not None:
        _log_fix_now(stream, solution.fix_times_s, solution.fixes)


def _log_landmarks(stream: RunStream, path: str, landmarks: Landmarks) -> None:
    stream.log_static(
        path,
        rr.Points3D(
            landmarks.world_p_landmark,
            colors=colours.green_to_red(landmarks.sigma_px, colours.GOOD_SIGMA_PX, colours.BAD_SIGMA_PX),
            radii=rr.Radius.ui_points(1.2),
        ),
        rr.AnyValues(sigma_px=landmarks.sigma_px),
    )


def fix_groups(solution: Solution) -> list[tuple[FixClass, Verdict, IntArray]]:
    """Return the rows of the fixes with a position by class and verdict, classes from best to worst."""
    if solution.judged_fixes is None:
        return []
    log, table = solution.judged_fixes
    positioned = np.isfinite(table.world_p_fix).all(axis=1)
    groups = []
    for fix_class in FixClass:
        for verdict in Verdict:
            pairs = zip(log.fix_class, table.verdict, strict=True)
            in_group: BoolArray = np.array([pair == (fix_class, verdict) for pair in pairs], bool)
            rows = np.flatnonzero(in_group & positioned)
            if len(rows):
                groups.append((fix_class, verdict, rows))
    return groups


def fixes_path(fix_class: FixClass, verdict: Verdict) -> str:
    """Return the entity path of the fixes of a class and verdict."""
    return f"{FIXES}/{fix_class}/{verdict.name.lower()}"


def extent_m(solution: Solution) -> float:
    """Return the longest side of the box around the camera's path, at least 1 m."""
    return max(1.0, float(np.ptp(solution.world_T_camera[:, :3, 3], axis=0).max()))


def _log_camera(stream: RunStream, solution: Solution) -> None:
    poses, camera = solution.world_T_camera, solution.camera
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    stream.send_frames(CAMERA, rr.Transform3D.columns(translation=poses[:, :3, 3], quaternion=quaternions))
    stream.log_static(
        IMAGE,
        rr.Pinhole(
            image_from_camera=camera.K,
            resolution=(camera.width, camera.height),
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=0.05 * extent_m(solution),
            color=colours.NOW,
        ),
    )


def _log_paths(stream: RunStream, solution: Solution) -> None:
    centres = solution.world_T_camera[:, :3, 3]
    bridged = np.array([state is FrameState.BRIDGED for state in solution.state], bool)
    strips = _runs(centres, bridged)
    stream.log_static(
        PATH,
        rr.LineStrips3D(
            [strip for strip, _ in strips],
            colors=[colours.BRIDGED if gap else colours.PATH for _, gap in strips],
            radii=rr.Radius.ui_points(2.0),
        ),
    )
    if solution.world_p_before is not None:
        stream.log_static(
            BEFORE,
            rr.LineStrips3D(
                [solution.world_p_before], colors=[colours.BEFORE], radii=rr.Radius.ui_points(1.2)
            ),
        )


def _runs(centres: FloatArray, bridged: BoolArray) -> list[tuple[FloatArray, bool]]:
    """Split the path where its state changes; a piece ends where the next one begins."""
    cuts = [0, *(np.flatnonzero(np.diff(bridged)) + 1).tolist(), len(centres)]
    return [(centres[first : last + 1], bool(bridged[first])) for first, last in itertools.pairwise(cuts)]


def _log_fixes(
    stream: RunStream, solution: Solution, fix_class: FixClass, verdict: Verdict, rows: IntArray
) -> None:
    _, table = gps_results(solution)
    path, colour = fixes_path(fix_class, verdict), colours.of_fix(fix_class, verdict)
    stream.log_static(
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
        stream.log_static(
            f"{path}/region",
            rr.Cylinders3D(
                centers=table.world_p_fix[sized],
                radii=table.r_m[sized],
                lengths=2.0 * table.h_m[sized],  # h is half the height, Eq. (16)
                colors=[(*colour[:3], _REGION_ALPHA)],
                fill_mode="solid",
                labels=[fix_title(solution, int(row)) for row in sized],
                show_labels=False,
            ),
        )
    estimated = rows[np.isfinite(table.residual_m[rows]).all(axis=1)]
    if len(estimated):
        fix = table.world_p_fix[estimated]
        lines = np.stack([fix, fix + table.residual_m[estimated]], axis=1)
        stream.log_static(
            f"{path}/residual",
            rr.LineStrips3D(list(lines), colors=[colour], radii=rr.Radius.ui_points(1.0)),
        )


def _log_fix_now(stream: RunStream, t_s: FloatArray, table: FixTable) -> None:
    """Log the region of the last fix before the current time as a white wireframe."""
    rows = np.flatnonzero(np.isfinite(table.world_p_fix).all(axis=1) & np.isfinite(table.r_m + table.h_m))
    if len(rows):
        stream.send_times(
            NOW,
            t_s[rows],
            rr.Cylinders3D.columns(
                centers=table.world_p_fix[rows], radii=table.r_m[rows], lengths=2.0 * table.h_m[rows]
            ),
        )
        stream.log_static(NOW, rr.Cylinders3D.from_fields(colors=[colours.NOW], fill_mode="majorwireframe"))
