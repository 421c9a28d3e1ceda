from dataclasses import replace

import numpy as np
from measurement_keys import documented

from vgps.writers.measurements import write_measurements


def test_the_keys_are_those_of_the_table(solution, tmp_path):
    write_measurements(solution, tmp_path / "m.npz")
    with np.load(tmp_path / "m.npz", allow_pickle=False) as archive:
        assert set(archive.files) == {key for key in documented() if not key.startswith("cameras.")}


def test_keys_of_absent_parts_are_absent(solution, tmp_path):
    bare = replace(solution, gps=None, fixes=None, world_p_before=None, control_points=None, graph=None)
    write_measurements(bare, tmp_path / "m.npz")
    with np.load(tmp_path / "m.npz") as archive:
        absent = documented() - set(archive.files)
    parts = ("gps.", "fixes.", "control_points.", "graph.", "cameras.")
    assert absent == {key for key in documented() if key.startswith(parts)} | {"world_p_before"}
