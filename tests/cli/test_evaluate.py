"""``vgps evaluate`` as a user runs it."""

import json

import pytest


@pytest.mark.slow
def test_errors_are_printed_as_json_and_as_a_table(smoothed, recording, vgps_verb):
    truth = recording / "truth.tum"
    code, out, _ = vgps_verb("evaluate", smoothed, "--truth", truth, "--json")
    assert code == 0
    assert json.loads(out)["camera_position_m"]["mean"] < 0.1
    code, out, _ = vgps_verb("evaluate", smoothed, "--truth", truth)
    assert code == 0 and "camera position [m]" in out
