"""The long recording of ``benchmarks.long`` is the short one, forwards and backwards."""

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import context, map_of, scene

from scripts.benchmarks import long
from vgps.config import Config
from vgps.gps.antenna_path import antenna_at, place
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.smoothing.scene.factor_graph import select_observations
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_d.batch_problem import BatchInput


@pytest.mark.slow
def test_tracks_and_fixes_fit_the_repeated_path_as_they_fit_the_run(monkeypatch):
    monkeypatch.setattr(long, "_START_M", 0.0)
    problem, true, _, fixes = scene(disturbed=0.0)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    given = BatchInput(
        scene=made,
        sigma_px=np.ones(len(made.points)),
        control_sigma_px=np.zeros(0),
        fixes=fixes,
        sensors=Sensors.fixed(ANTENNA),
        fixed=None,
        context=context(Config()),
    )
    found = long.repeated(given, 3)
    frames, last = len(found.scene.t_s), len(true) - 1
    assert frames == 3 * last + 1
    np.testing.assert_array_equal(found.scene.poses[[0, last, 2 * last, 3 * last]], true[[0, last, 0, last]])
    selected, sigma = select_observations(found.scene, given.context)
    kept = len(selected.observations.frame) / len(found.scene.observations.frame)
    assert kept > 0.99  # tracks that end at a turn lose a view, and some are too short then
    assert np.nanmax(sigma) <= np.nanmax(select_observations(made, given.context)[1]) + 1e-9
    rows = found.scene.observations.frame * len(found.scene.points) + found.scene.observations.landmark
    assert len(np.unique(rows)) == len(rows)

    def error_m(one):
        antenna = antenna_at(one.scene.poses, place(one.scene.t_s, one.fixes.t_s), ANTENNA)
        return np.linalg.norm(antenna - one.fixes.world_p_fix, axis=1).max()

    assert len(found.fixes) >= 3 * (len(fixes) - 2) and error_m(found) <= error_m(given) + 1e-6
