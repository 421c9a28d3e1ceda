from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from block_laps import block_laps
from fewer_features import fewer_features
from solutions import on_a_rig
from textured_room import CAMERA

import vgps
from vgps.errors import RunFolderError
from vgps.geodesy import to_geodetic
from vgps.landmarks.build import build_from_runs
from vgps.model import Camera, GeodeticPoint
from vgps.pipeline.join import _check_shutters
from vgps.pipeline.join_folders import join_folders
from vgps.readers.run_files import read_summary, run_folders
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, SceneConfig, simulate
from vgps.simulate.camera_path import level_path
from vgps.simulate.scene import on_path
from vgps.writers.run_folder import write_run

DRIVE = replace(SCENES["drive"], width=270, height=134, focal_px=157.5, texture_scale=0.5)
ORIGIN = GeodeticPoint(34.7326, 135.7346, 121.0)


def laps() -> dict[str, SceneConfig]:
    """Two laps around a block in one world, with cameras, lever arms, origins and errors of their own."""
    poses = block_laps(1.9, side_m=24.0, step_m=0.8, lane_m=0.8)
    gps = replace(DRIVE.gps, fix_share=0.0)
    first = on_path(replace(DRIVE, gps=gps), level_path(poses, 10.0, slice(0, 60)))
    second = replace(DRIVE, gps=replace(gps, seed=5), width=246, focal_px=141.0)
    second = replace(second, camera_p_antenna=(0.3, -0.5, -1.0))
    return {"monday": first, "friday": on_path(second, level_path(poses, 10.0, slice(120, 180)))}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder, made = tmp_path_factory.mktemp("laps"), []
    for name, scene in laps().items():
        simulate(folder / f"recording_{name}", scene, seed=0)
        if name == "friday":  # another origin for the same log
            rig = folder / f"recording_{name}" / "rig.yaml"
            fields = yaml.safe_load(rig.read_text())
            rig.write_text(yaml.safe_dump({**fields, "world_origin": list(ORIGIN)}))
        write_run(
            vgps.smooth(vgps.open_recording(folder / f"recording_{name}"), fewer_features(150)), folder / name
        )
        made.append(folder / name)
    return made


def geodetic(run: vgps.Solution) -> np.ndarray:
    assert run.world_origin is not None
    return to_geodetic(run.world_origin, run.world_T_camera[:, :3, 3])


@pytest.mark.slow
def test_two_laps_are_better_together(runs: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    joined = join_folders(runs, out)
    assert joined.ties[1, 0] > 3 and joined.ties.sum() == joined.ties[1, 0] and not joined.warnings
    offsets = []
    for path, solution in zip(runs, joined.solutions, strict=True):
        truth = read_trajectory(path.with_name(f"recording_{path.name}") / "truth.tum")
        before = read_run(path)
        places = to_geodetic(DRIVE.world_origin, truth.world_T_camera[:, :3, 3])
        scale = np.array([111e3, 91e3, 1.0])  # metres for a degree
        offsets.append([(scale * (geodetic(one) - places)).mean(axis=0) for one in (before, solution)])
        again = read_run(out / path.name)
        np.testing.assert_array_equal(again.world_T_camera, solution.world_T_camera)
        assert again.world_origin == joined.solutions[0].world_origin
        assert again.fixes is not None
        assert np.nanmax(np.abs(again.fixes.residual_m)) < 20.0
    apart = [np.linalg.norm(offsets[0][k] - offsets[1][k]) for k in range(2)]
    assert apart[1] < 0.3 * apart[0]  # the runs agree
    summary = read_summary(out)
    assert summary["counts"]["frames"] == 120 and summary["counts"]["ties"] == joined.ties.sum()
    assert run_folders(out) == [out / "monday", out / "friday"]
    with pytest.raises(RunFolderError, match="holds several runs"):
        read_run(out)
    assert len(build_from_runs([out]).sources) == 2


@pytest.mark.slow
def test_runs_that_do_not_meet_say_so(runs: list[Path], tmp_path: Path) -> None:
    far = read_run(runs[1])
    assert far.world_origin is not None
    away = far.world_origin._replace(latitude_deg=far.world_origin.latitude_deg + 0.01)
    write_run(replace(far, world_origin=away), tmp_path / "far")
    joined = join_folders([runs[0], tmp_path / "far"], tmp_path / "out")
    assert joined.ties.sum() == 0
    assert joined.warnings[0].startswith("no place seen by another run is seen by monday, far")


def test_shutters_are_joined_if_they_roll_alike() -> None:
    def runs_of(*cameras: Camera) -> Any:
        return [
            SimpleNamespace(name=f"run{k}", solution=SimpleNamespace(camera=one))
            for k, one in enumerate(cameras)
        ]

    rolls = replace(CAMERA, readout_s=0.02)
    _check_shutters(runs_of(rolls, rolls))
    _check_shutters(runs_of(CAMERA, replace(CAMERA, width=200)))
    for other in (CAMERA, replace(rolls, width=200), replace(rolls, readout_axis="columns")):
        with pytest.raises(
            RunFolderError, match=r"rolling shutters that differ \(run0: 320 x 240, rows, 0.02 s"
        ):
            _check_shutters(runs_of(rolls, other))


@pytest.mark.slow
def test_what_cannot_be_joined_is_one_line(runs: list[Path], tmp_path: Path) -> None:
    run = read_run(runs[0])
    cases = {
        "lost": (replace(run, georeferenced=False), "is not georeferenced"),
        "old": (replace(run, graph=None), "holds no arrays graph"),
        "gone": (replace(run, recording=tmp_path / "nowhere"), "pictures of its recording cannot be read"),
        "none": (replace(run, recording=None), "names no recording"),
        "rolls": (replace(run, camera=replace(run.camera, readout_s=0.02)), "rolling shutters that differ"),
        "rig": (on_a_rig(run), "rig: a run of 2 cameras; expected runs of one camera each"),
    }
    for name, (solution, message) in cases.items():
        write_run(solution, tmp_path / name)
        with pytest.raises(RunFolderError, match=message):
            join_folders([runs[1], tmp_path / name], tmp_path / "out")
    for names, out, message in (
        ([runs[0]], "out", "1 run; expected at least two"),
        ([runs[0], runs[0]], "out", "two runs are named monday"),
        (runs, runs[0], "is or holds a run"),
        (runs, runs[0].parent, "is or holds a run"),
    ):
        with pytest.raises(RunFolderError, match=message):
            join_folders(names, tmp_path / out)
    assert not (tmp_path / "out").exists()
