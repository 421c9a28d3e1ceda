"""How much of an IMU's gain is lost where the truth that its data are made from contradicts the pictures?

Fixes and IMU data of the KITTI recordings are made from KITTI's truth, the result of an inertial navigation
system, whose direction of motion wanders against that of the pictures. Stage D runs on the tracks of the
video as the pictures show them, and on the same tracks where the truth's camera would have seen them: each
feature at the position that the truth's poses give it, with white noise of the standard deviation that the
run on the pictures found for it. Fixes and IMU data are the same in all rows.

Tilt is that of `benchmarks.imu`. Motion is the angle between the directions of motion over a second of result
and truth, each in its own camera's axes, in the mean over the distance.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.drives import Drive, open_drive
from scripts.common.markdown import LiveTable
from scripts.common.path_angles import motion_deg, tilt
from vgps.geometry.projection import project
from vgps.model import Recording
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.gps_clock import with_gps_clock
from vgps.pipeline.readout_estimation import optimise_readout
from vgps.pipeline.solved_maps import merged_maps
from vgps.runtime.progress import NoProgress
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.scene.triangulation import triangulated
from vgps.smoothing.stage_d.batch_result import BatchResult
from vgps.solution import Trajectory

COLUMNS = ("recording", "seed", "tracks", "IMU", "mean [m]", "stated [m]", "tilt [deg]", "motion [deg]")
_FAR_PX = 20.0  # from the pictures: then the truth's poses gave the feature no position
_VIEWS = 3  # that a position takes


def as_the_truth_saw(
    merged: MergedMaps, front_end: FrontEnd, found: BatchResult, true: Trajectory, seed: int
) -> MergedMaps:
    """Return maps with the observations of the truth's camera.

    Args:
        merged: Maps before stage D.
        front_end: Their stages A to C.
        found: Stage D on the pictures; the noise of its features is that of the new observations.
        true: Poses of all frames.
        seed: Of the noise.
    """
    scene, context = merged.scene, front_end.context(vgps.Config())
    every, unknown = np.ones(len(scene.points), dtype=bool), np.full_like(scene.points, np.nan)
    on_truth = replace(scene, poses=true.world_T_camera, points=unknown)
    seen = scene.observations
    points = triangulated(on_truth, every, context, _VIEWS).points[seen.landmark]
    projected, depth = project(context.K, true.world_T_camera[seen.frame], points[:, None])
    uv_px = projected[:, 0]
    near = (depth[:, 0] > 0.0) & (np.linalg.norm(uv_px - seen.uv_px, axis=1) < _FAR_PX)
    sigma_px = np.where(np.isfinite(found.sigma_px), found.sigma_px, np.nanmedian(found.sigma_px))
    noise = np.random.default_rng([seed, 5]).standard_normal(uv_px.shape) * sigma_px[seen.landmark, None]
    moved = replace(scene, observations=replace(seen, uv_px=uv_px + noise).rows(near), points=unknown)
    return replace(merged, scene=triangulated(moved, every, context, _VIEWS))


def opened(drive: Drive, log: str, imu: Path, rig: Path) -> Recording:
    """Return a drive with a shipped log, the IMU and its rig."""
    whole = vgps.open_recording(drive.folder, with_gps=False, imu=imu.resolve(), rig=rig.resolve())
    assert whole.imu is not None
    moved = replace(whole.imu, t_s=whole.imu.t_s - drive.start_s)
    gps = drive.read_log(drive.shipped()[log])
    return replace(drive.recording, rig=whole.rig, imu=moved, gps=gps)


def figures(batch: BatchResult, true: Trajectory) -> list[float]:
    """Return mean error, mean stated standard deviation [m], tilt and motion [deg]."""
    found = batch.trajectory
    error = np.linalg.norm(found.world_T_camera[:, :3, 3] - true.world_T_camera[:, :3, 3], axis=1)
    stated = np.sqrt(np.trace(batch.covariance[:, 3:, 3:], axis1=1, axis2=2))
    return [float(error.mean()), float(stated.mean()), tilt(found, true)[0], motion_deg(found, true)]


def main() -> None:
    """Print a row for the pictures and for the truth's, without and with the IMU, as it comes."""
    parser = ScriptParser("experiments.imu_limit", __doc__)
    parser.add_argument("recordings", nargs="+", help="folders in --data, as kitti03:300-800 for some frames")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the recordings")
    parser.add_argument("--log", required=True, help="name inside the recording")
    parser.add_argument("--imu", type=Path, required=True, help="imu.csv")
    parser.add_argument("--rig", type=Path, required=True, help="rig.yaml with imu_R_camera")
    add_seeds(parser, 1)
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for name in given.recordings:
            drive = open_drive(name, given.data, given.data)
            recording = opened(drive, given.log, given.imu, given.rig)
            for seed in range(given.seeds):
                for tracks, used, found in runs(recording, drive.truth, seed):
                    row = dict(zip(("mean_m", "stated_m", "tilt_deg", "motion_deg"), found, strict=True))
                    results.add(recording=name, seed=seed, tracks=tracks, imu=used, **row)
                    words = [f"{value:.3f}" for value in found]
                    table.add(name, str(seed), tracks, "yes" if used else "no", *words)


def runs(recording: Recording, true: Trajectory, seed: int) -> Iterator[tuple[str, bool, list[float]]]:
    """Yield whose tracks, whether the IMU was used, and the figures of stage D."""
    config = vgps.Config(seed=seed)
    tracked = run_front_end(recording, config, NoProgress())
    tracked = with_gps_clock(tracked, config)
    pictures = merged_maps(tracked, tracked.context(config))
    alone = replace(tracked, recording=replace(recording, imu=None))
    for used, front_end in ((False, alone), (True, tracked)):
        found, *_ = optimise_readout(front_end, pictures, front_end.fixes, config)
        yield "pictures", used, figures(found, true)
        exact = as_the_truth_saw(pictures, front_end, found, true, seed)
        found, *_ = optimise_readout(front_end, exact, front_end.fixes, config)
        yield "truth", used, figures(found, true)


if __name__ == "__main__":
    main()
