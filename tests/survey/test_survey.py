import numpy as np
import pytest
import yaml
from csv_logs import ORIGIN, csv_log
from pydantic import ValidationError

from vgps.config import SurveyConfig, read_survey
from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.survey import region, survey_logs
from vgps.survey.output import as_tables, plot_survey, write_survey


@pytest.mark.slow
def test_two_logs_are_one_survey_and_the_result_feeds_smooth(tmp_path):
    rng = np.random.default_rng(1)
    fix = rng.normal(0, 0.01, (200, 3))
    float_ = rng.normal([0.0, 0.0, 3.0], 1.0, (200, 3))
    logs = [
        csv_log(tmp_path / "a.csv", fix, ["rtk_fix"] * 200),
        csv_log(tmp_path / "b.csv", float_, ["rtk_float"] * 200),
    ]
    options = SurveyConfig(speed_m_s=1.2, vertical_speed_m_s=0.3, frame_rate=15.0)
    found = survey_logs(logs, options)
    assert np.abs(np.subtract(found.truth, ORIGIN)).max() < 0.01
    by_class = {one.fix_class: one for one in found.classes}
    expected = region(float_ - fix.mean(axis=0), 0.05)
    assert by_class[FixClass.RTK_FLOAT].r_m == pytest.approx(expected[0] + 1.2 / 30, abs=1e-4)
    assert by_class[FixClass.RTK_FLOAT].h_m == pytest.approx(expected[1] + 0.3 / 30, abs=1e-4)
    write_survey(found, options, tmp_path / "s.yaml")
    regions = read_survey(tmp_path / "s.yaml")
    assert regions[FixClass.RTK_FLOAT].r_m == pytest.approx(by_class[FixClass.RTK_FLOAT].r_m, abs=1e-4)
    ellipsoid = by_class[FixClass.RTK_FLOAT].ellipsoid
    assert regions[FixClass.RTK_FLOAT].alpha_m == pytest.approx(ellipsoid.alpha_m, abs=1e-4)
    assert regions[FixClass.RTK_FLOAT].beta_m == pytest.approx(ellipsoid.beta_m, abs=1e-4)
    written = yaml.safe_load((tmp_path / "s.yaml").read_text())["rtk_fix"]
    assert written["epochs"] == 200
    assert written["noise_m"] == pytest.approx(0.01, rel=0.1) and written["walk_m"] < 0.003
    assert written["vertical"] == pytest.approx(1.0, rel=0.2) and 0.5 <= written["tail"] <= 30
    plot_survey(found, tmp_path / "s.png")
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")
    assert len(as_tables(found, options)) == 3


@pytest.mark.slow
def test_without_a_fix_the_truth_must_be_given(tmp_path):
    log = csv_log(tmp_path / "a.csv", np.ones((30, 3)), ["rtk_float"] * 30)
    with pytest.raises(GpsLogError, match="--truth"):
        survey_logs([log])
    found = survey_logs([log], truth=ORIGIN)
    assert found.classes[0].r_m == pytest.approx(np.sqrt(2.0), abs=1e-3)
    assert "30 epochs count as" in found.warnings[-1]


def test_a_receiver_that_moves_is_refused(tmp_path):
    walk = np.arange(60)[:, None] * [1.0, 0.0, 0.0]
    with pytest.raises(GpsLogError, match="moved"):
        survey_logs([csv_log(tmp_path / "a.csv", walk, ["rtk_fix"] * 60)])


@pytest.mark.slow
def test_the_limits_of_a_survey_are_settings(tmp_path):
    walk = np.arange(60)[:, None] * [0.1, 0.0, 0.0]
    log = csv_log(tmp_path / "a.csv", walk, ["rtk_fix"] * 60)
    with pytest.raises(GpsLogError, match="moved"):
        survey_logs([log])
    few = survey_logs([log], SurveyConfig(max_spread_m=2.0))
    assert len(few.warnings) == 1
    apart = survey_logs([log], SurveyConfig(max_spread_m=2.0, max_gap_s=0.5))
    assert apart.classes[0].memory is None and "only 0 epochs follow another" in apart.warnings[-1]
    assert not survey_logs([log], SurveyConfig(max_spread_m=2.0, min_independent_epochs=0.5)).warnings


@pytest.mark.parametrize("options", [{"drop": 1.0}, {"drop": -0.1}, {"frame_rate": 0.0}])
def test_impossible_options_are_refused(options):
    with pytest.raises(ValidationError):
        SurveyConfig(**options)


@pytest.mark.slow
def test_regions_of_the_real_receiver(data_dir):
    found = {one.fix_class: one for one in survey_logs([data_dir / "survey/stationary.nmea"]).classes}
    fix, float_ = found[FixClass.RTK_FIX], found[FixClass.RTK_FLOAT]
    assert (fix.epochs, float_.epochs, found[FixClass.SINGLE].epochs) == (316, 289, 9)
    assert fix.r_m == pytest.approx(0.02, abs=0.01) and fix.h_m == pytest.approx(0.02, abs=0.01)
    assert float_.r_m == pytest.approx(2.4, abs=0.1) and float_.h_m == pytest.approx(6.5, abs=0.3)
    assert float_.independent < 20 < fix.independent


@pytest.mark.slow
def test_changes_do_not_reach_from_one_log_into_the_next(tmp_path):
    rng = np.random.default_rng(2)
    logs = [csv_log(tmp_path / f"{k}.csv", rng.normal(0, 0.01, (30, 3)), ["rtk_fix"] * 30) for k in range(2)]
    assert survey_logs(logs).classes[0].changes == 58


@pytest.mark.slow
def test_a_drive_with_a_reference(tmp_path):
    rng = np.random.default_rng(3)
    drive = np.arange(300)[:, None] * [10.0, 3.0, 0.1]
    error = np.cumsum(rng.normal(0, 0.02, drive.shape), axis=0)
    better = csv_log(tmp_path / "b.csv", drive, ["rtk_fix"] * 200 + ["rtk_float"] * 100)
    own = csv_log(tmp_path / "a.csv", drive + error, ["rtk_float"] * 300)
    found = survey_logs([own], truth=better)
    assert found.truth == better and found.classes[0].epochs == 200
    np.testing.assert_allclose(found.errors_m, error[:200], atol=1e-3)
    assert found.classes[0].memory.walk_m == pytest.approx(0.02, rel=0.15)
    assert found.classes[0].memory.noise_m < 0.006
