from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import T_S, drifting, fixes_at, path, poses

from vgps.config import Config
from vgps.smoothing.drift import bend_path


@pytest.fixture
def fixes():
    return fixes_at(np.arange(0.05, 19.0), 0.5, 0.7)


def away(bent):
    return np.linalg.norm(bent[:, :3, 3] - path(T_S), axis=1)


def test_forty_percent_of_scale_drift_is_taken_out(fixes):
    assert away(drifting()).mean() > 5.0
    bent, scale = bend_path(drifting(), T_S, fixes, np.zeros(3), Config())
    assert away(bent).mean() < 0.5
    assert scale[5] == pytest.approx(1.0, abs=0.1) and scale[-5] == pytest.approx(1 / 1.4, abs=0.1)


def test_one_wild_fix_bends_nothing(fixes):
    wild = fixes.world_p_fix.copy()
    wild[9] += [40.0, 0.0, 0.0]
    bent, _ = bend_path(poses(path(T_S)), T_S, replace(fixes, world_p_fix=wild), np.zeros(3), Config())
    assert away(bent).max() < 0.3
