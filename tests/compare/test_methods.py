import json
import re

import numpy as np
import pytest
import yaml

import vgps
from vgps.compare import METHODS, Method, as_json, compare, write_comparison
from vgps.compare.page import ratios
from vgps.config import Config
from vgps.errors import TrajectoryError
from vgps.readers.calibration import read_rig
from vgps.runtime.progress import NoProgress

CHOSEN = [METHODS[0], METHODS[1], METHODS[4]]


@pytest.fixture(scope="module")
def comparison(recording):
    opened = vgps.open_recording(recording)
    return compare(opened, recording / "truth.tum", Config(), NoProgress(), CHOSEN)


def test_methods_are_the_thesis_s_and_a_robust_one():
    assert [method.model for method in METHODS] == [
        "none",
        "gaussian",
        "gaussian-receiver",
        "ellipsoid",
        "cylinder",
        "cauchy",
    ]


def test_every_method_poses_every_frame_and_only_the_model_differs(comparison, recording):
    assert list(comparison.evaluations) == [method.name for method in CHOSEN]
    assert all(one.every_frame_posed for one in comparison.evaluations.values())
    assert comparison.evaluations["cylinder (16)"].camera_position_m.mean < 0.1
    alone = vgps.smooth(vgps.open_recording(recording), Config())
    np.testing.assert_array_equal(comparison.paths["cylinder (16)"], alone.world_T_camera[:, :3, 3])


def test_the_video_alone_begins_where_it_truly_was(comparison):
    error = np.linalg.norm(comparison.evaluations["A video only"].camera_error_m, axis=1)
    assert error[:30].mean() < 0.1 and error[-1] > error[:30].mean()


def test_page_and_data(comparison, tmp_path):
    page, data = write_comparison(comparison, tmp_path / "deeper")
    html = page.read_text()
    assert html.count("<tr>") == 1 + len(CHOSEN) and html.count("data:image/svg+xml;base64,") == 2
    assert not re.search(r"(src|href)=\"http", html)  # it stands alone
    assert json.loads(data.read_text()) == json.loads(json.dumps(as_json(comparison)))
    assert set(as_json(comparison)["methods"]["cylinder (16)"]) >= {"camera_position_m", "seconds", "nees"}


def test_ratios_are_of_the_antenna_s_mean_errors(comparison):
    found, errors = ratios(comparison), comparison.evaluations
    b, own = (errors[METHODS[k].name].antenna_position_m.mean for k in (1, 4))
    assert found["cylinder (16)"] == {"to_B": pytest.approx(own / b)}
    assert found[METHODS[1].name]["to_B"] == 1.0


def test_a_truth_of_another_place_is_told(recording, tmp_path):
    (tmp_path / "truth.tum").write_bytes((recording / "truth.tum").read_bytes())
    rig = yaml.safe_load((recording / "rig.yaml").read_text())
    origin = read_rig(recording / "rig.yaml").world_origin
    rig["world_origin"] = [origin.latitude_deg, origin.longitude_deg, origin.height_m + 5.0]
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    opened = vgps.open_recording(recording)
    with pytest.raises(TrajectoryError, match="world_origin"):
        compare(opened, tmp_path / "truth.tum", Config(), NoProgress(), [Method("cylinder", "cylinder")])
