from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from block_laps import block_laps
from fewer_features import fewer_features
from textured_room import CAMERA, room_recording

import vgps
from vgps.config import Config, LoopsConfig
from vgps.errors import GeometryError
from vgps.model import Frame
from vgps.pipeline import loop_closure, offline
from vgps.pipeline.front_end import FrontEnd
from vgps.pipeline.loop_closure import with_loops
from vgps.pipeline.offline import optimise_all
from vgps.places.loops import Loop
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import NoProgress
from vgps.simulate import SCENES, simulate
from vgps.simulate.camera_path import level_path
from vgps.simulate.scene import on_path
from vgps.smoothing.merging.merge_maps import MergedMaps
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations
from vgps.writers.run_folder import write_run


def test_loops_add_observations_once() -> None:
    old = Observations(np.array([0, 0, 1, 7]), np.array([0, 1, 1, 1]), np.full((4, 2), 100.0))
    scene = Scene(np.arange(8.0), np.tile(np.eye(4), (8, 1, 1)), np.ones((2, 3)), old)
    loop = Loop(
        frame=7,
        earlier=0,
        world_T_camera=np.eye(4),
        landmark=np.array([0, 1]),
        raw_uv_px=np.array([[50.0, 60.0], [70.0, 80.0]]),
    )
    made = with_loops(scene, (loop,), CAMERA)  # frame 7 observes landmark 1 already
    assert made.observations.frame.tolist() == [0, 0, 1, 7, 7]
    assert made.observations.landmark.tolist() == [0, 1, 1, 1, 0]
    assert made.observations.uv_px[-1].tolist() == [50.0, 60.0]
    assert made.loop is not None and made.loop.tolist() == [-1, -1, -1, -1, 0]


@pytest.mark.parametrize("optimum", [None, SimpleNamespace(loop=np.array([-1, -1]))])
def test_loops_that_no_optimum_fits_are_refused(monkeypatch: pytest.MonkeyPatch, optimum: object) -> None:
    path = SimpleNamespace(world_T_camera=None)
    first = SimpleNamespace(trajectory=path, points=None, assessment=None)
    refined = SimpleNamespace(camera=CAMERA)
    results = iter([(first, refined, None)] + ([] if optimum is None else [(optimum, refined, None)]))
    cameras: list[object] = []

    def optimise(*given: object) -> object:
        cameras.extend(given[4:])
        try:
            return next(results)
        except StopIteration:
            raise GeometryError("the optimiser made no step") from None

    monkeypatch.setattr(loop_closure, "optimise_readout", optimise)
    shown: list[Frame] = []

    def find(_video: object, frames: Iterable[Frame], _config: object) -> tuple[str, ...]:
        shown.extend(frames)
        return ("a loop",)

    monkeypatch.setattr(loop_closure, "find_loops", find)
    monkeypatch.setattr(loop_closure, "with_loops", lambda scene, *_: scene)
    monkeypatch.setattr(loop_closure, "_posed_video", lambda *_: None)
    poses = np.tile(np.eye(4), (2, 1, 1))
    none: Any = None
    front_end: Any = SimpleNamespace(
        recording=room_recording(poses),
        t_s=np.zeros(2),
        static_regions=np.array([[0, 0, 0, 0, 9, 9]]),
        moving_regions=np.zeros((0, 6), int),
        journal=None,
    )
    scene = Scene(np.zeros(2), poses, np.zeros((0, 3)), Observations(none, none, none))
    merged = MergedMaps(
        scene=scene, assessment=none, state=(), gray=np.zeros(0), georeferenced=True, warnings=()
    )
    result, loops = loop_closure.optimise_loops(front_end, merged, none, Config(), NoProgress())
    assert result[0] is first and loops.shape == (0, 2)
    assert cameras == [CAMERA]  # that of the solution at which the second one starts
    assert shown[0].mask is not None and shown[1].mask is None  # what never moves is not searched


@pytest.mark.slow
def test_a_second_lap_is_tied_to_the_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(SCENES["drive"], width=360, height=180, focal_px=210.0, texture_scale=0.5)
    scene = replace(scene, gps=replace(scene.gps, fix_share=0.05))
    path = level_path(block_laps(1.35, side_m=24.0, step_m=0.8, lane_m=0.8), 10.0)
    simulate(tmp_path / "laps", on_path(scene, path), seed=1)
    recording = vgps.open_recording(tmp_path / "laps")
    truth = read_trajectory(tmp_path / "laps/truth.tum").world_T_camera[:, :3, 3]
    front_ends: list[FrontEnd] = []
    monkeypatch.setattr(
        offline, "optimise_all", lambda found, *rest: front_ends.append(found) or optimise_all(found, *rest)
    )
    config = fewer_features(300).model_copy(update={"seed": 1})  # 0.2 m without loops; 0.1 m with seed 0
    tied = vgps.smooth(recording, config)
    alone = optimise_all(front_ends[0], config.model_copy(update={"loops": LoopsConfig(close="no")}))
    assert len(alone.loops) == 0 and len(tied.loops) > 3
    lap = round(4 * 24.0 / 0.8)
    assert np.abs(tied.loops[:, 0] - tied.loops[:, 1] - lap).max() < 12  # no wrong one
    error = [np.linalg.norm(run.world_T_camera[:, :3, 3] - truth, axis=1) for run in (alone, tied)]
    assert error[1].mean() < 0.6 * error[0].mean()
    # the sigmas say so, and are not too small
    sigma = [np.linalg.norm(run.sigma_position_m, axis=1) for run in (alone, tied)]
    assert np.median(sigma[1]) < np.median(sigma[0])
    assert np.mean(error[1] < 3.0 * sigma[1]) > 0.9
    write_run(tied, tmp_path / "run")
    np.testing.assert_array_equal(read_run(tmp_path / "run").loops, tied.loops)
    assert vgps.factor_graph(tmp_path / "run")[0].size() > 0
