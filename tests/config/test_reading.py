import re
from pathlib import Path

import pytest
import yaml
from pydantic import ValidationError

from vgps.config import (
    Config,
    IntrinsicsConfig,
    OutlierConfig,
    RollingShutterConfig,
    TrackingConfig,
    WindowConfig,
    read_config,
    read_survey,
)
from vgps.errors import ConfigError
from vgps.model import FixClass

V0_1 = Path(__file__).parent / "settings_0_1"  # all defaults of version 0.1, under the names of then


def written(path, text):
    path.write_text(text)
    return path


def test_a_file_overrides_what_it_names_and_nothing_else(tmp_path):
    found = read_config(written(tmp_path / "c.yaml", "gps: {n: 8}\nseed: 7\n"))
    assert (found.gps.n, found.seed) == (8, 7)
    assert found.gps.omega == Config().gps.omega and found.tracking == Config().tracking


def test_yes_and_no_are_words_though_yaml_reads_them_as_true_and_false(tmp_path):
    text = "rolling_shutter: {estimate: yes}\nsensors: {estimate_time_offset: no}\nintrinsics: {refine: no}\n"
    found = read_config(written(tmp_path / "c.yaml", text))
    assert found.rolling_shutter.estimate == "yes"
    assert found.sensors.estimate_time_offset == found.intrinsics.refine == "no"
    assert RollingShutterConfig.model_validate({"estimate": False}).estimate == "no"
    with pytest.raises(ConfigError, match="key seed: found 'yes'"):
        read_config(written(tmp_path / "d.yaml", "seed: 'yes'\n"))


def test_the_resolved_configuration_reads_back_the_same(tmp_path):
    before = Config(seed=3).with_gps("ellipsoid")
    file = written(tmp_path / "c.yaml", yaml.safe_dump(before.model_dump(mode="json")))
    assert read_config(file) == before


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("gps: {m: 8}", "key gps.m: unknown key"),
        ("gps: {n: 0}", "key gps.n"),
        ("tracking: {method: orb}", "key tracking.method"),
        ("- 1\n- 2", "found a list"),
        ("gps: [", "not YAML"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path, text, told):
    with pytest.raises(ConfigError, match=told):
        read_config(written(tmp_path / "c.yaml", text))


@pytest.mark.parametrize(
    ("text", "guess"),
    [
        ("gps: {omga: 1}", "key gps.omga: unknown key; did you mean gps.omega?"),
        ("gsp: {omega: 1}", "key gsp: unknown key; did you mean gps?"),
        ("omega: 1", "key omega: unknown key; did you mean gps.omega?"),
        ("localization: {octave_unit: 1}", "did you mean landmarks.octave_unit or localization.selection"),
        ("zzz: 1", "key zzz: unknown key; remove it or correct its spelling; vgps config lists"),
    ],
)
def test_an_unknown_key_is_answered_by_the_setting_that_may_be_meant(tmp_path, text, guess):
    with pytest.raises(ConfigError, match=re.escape(guess)):
        read_config(written(tmp_path / "c.yaml", text))


def test_the_file_that_version_0_1_had_for_the_tracker_is_read(tmp_path, caplog):
    text = "estimator: frame\nwindow: fixed\nselection: {max_tilt_deg: 60}\n"
    found = read_config(written(tmp_path / "track.yaml", text))
    tracker = found.localization
    assert (tracker.estimator, tracker.window, tracker.selection.max_tilt_deg) == ("frame", "fixed", 60.0)
    assert found.window == Config().window
    assert len(caplog.messages) == 3
    assert caplog.messages[0].endswith("track.yaml: setting estimator is now called localization.estimator")


def test_settings_of_version_0_1_are_read_under_their_old_names(tmp_path, caplog):
    text = "judge: {tail_size: 3.0}\nsensors: {lag_s: 0.1, estimate_lag: 'no'}\nmin_sightings: 5\n"
    found = read_config(written(tmp_path / "c.yaml", text))
    assert found.outliers.tail_size == 3.0
    assert (found.sensors.time_offset_s, found.sensors.estimate_time_offset) == (0.1, "no")
    assert found.landmarks.min_observations == 5
    assert len(caplog.messages) == 5  # one more for the place of min_sightings


def test_a_setting_given_twice_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="outliers is also given under its old name judge; keep one"):
        read_config(written(tmp_path / "c.yaml", "judge: {tail_size: 3}\noutliers: {tail_size: 2}\n"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("outliers: {outlier_share: 5}", "key outliers.outlier_share: found 5; expected less than 1"),
        ("outliers: {lower_share: 1.5}", "key outliers.lower_share: found 1.5; expected less than 1"),
        ("outliers: {tail_share: 1.0}", "key outliers.tail_share: found 1.0; expected less than 1"),
        ("outliers: {persistence: 2}", "key outliers.persistence: found 2; expected less than 1"),
        ("outliers: {path_tolerance: 0}", "key outliers.path_tolerance: found 0; expected greater than 0"),
        (
            "outliers: {outlier_share: 0.6, lower_share: 0.4}",
            "key outliers: outlier_share and lower_share together are not below 1",
        ),
        ("tracking: {min_inlier_share: 30}", "key tracking.min_inlier_share: found 30; expected less than 1"),
        ("localization: {min_correlation: 1.1}", "expected less than or equal to 1"),
        ("sensors: {time_offset_s: .nan}", "key sensors.time_offset_s: found nan; expected a finite number"),
        ("gps: {regions: {rtk_fix: {r_m: 1}}}", "key gps.regions.rtk_fix.h_m: is missing"),
    ],
)
def test_numbers_out_of_their_range_are_refused(tmp_path, text, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        read_config(written(tmp_path / "c.yaml", text))


def test_an_empty_section_changes_nothing(tmp_path):
    assert read_config(written(tmp_path / "c.yaml", "gps:\nlocalization:\n  selection:\n")) == Config()


def test_an_empty_file_and_none_are_the_defaults(tmp_path):
    assert read_config(written(tmp_path / "c.yaml", "")) == read_config(None) == Config()


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(ConfigError, match="No such file"):
        read_config(tmp_path / "none.yaml")


def test_a_survey_gives_the_regions_of_the_classes_it_names(tmp_path):
    file = written(tmp_path / "s.yaml", "rtk_fix: {r_m: 0.02, h_m: 0.03, epochs: 9}\nsurvey: {drop: 0.05}\n")
    config = Config().with_gps(None, file)
    assert set(config.gps.regions) == {FixClass.RTK_FIX} and config.gps.regions[FixClass.RTK_FIX].h_m == 0.03


def test_a_survey_bounds_the_offsets_and_gives_their_walk(tmp_path):
    text = "rtk_float: {r_m: 0.4, h_m: 0.9, walk_m: 0.011, tail: 1.2}\ndgps: {r_m: 1.0, h_m: 2.0}\n"
    gps = Config().with_gps(None, written(tmp_path / "s.yaml", text)).gps
    found, default = gps.offset_errors(FixClass.RTK_FLOAT), Config().gps.memory
    assert (found.r_m, found.h_m, found.walk_m, found.tail) == (0.4, 0.9, 0.011, 1.2)
    assert found.walk_spread == gps.memory.own_spread  # a survey of this receiver is believed
    assert found.noise_spread == default.classes[FixClass.RTK_FLOAT].noise_spread
    assert found.noise_m == default.classes[FixClass.RTK_FLOAT].noise_m
    assert found.between_receivers == default.own_spread
    assert gps.offset_errors(FixClass.DGPS).walk_m == default.classes[FixClass.DGPS].walk_m


@pytest.mark.parametrize("key", ["walk_m: -1", "tail: 0", "noise_m: far"])
def test_an_impossible_walk_in_a_survey_is_told(tmp_path, key):
    file = written(tmp_path / "s.yaml", f"rtk_fix: {{r_m: 0.02, h_m: 0.03, {key}}}")
    with pytest.raises(ConfigError, match=f"rtk_fix.{key.split(':')[0]}"):
        Config().with_gps(None, file)


@pytest.mark.parametrize(
    "text", ["rtk_fix: {r_m: 0.02}", "rtk_fix: {r_m: -1, h_m: 1}", "other: {r_m: 1, h_m: 1}"]
)
def test_an_impossible_survey_is_told(tmp_path, text):
    with pytest.raises(ConfigError):
        read_survey(written(tmp_path / "s.yaml", text))


def test_values_cannot_be_changed_or_invented():
    with pytest.raises(ValidationError):
        Config().seed = 4
    with pytest.raises(ValidationError):
        OutlierConfig(outlier_share=-0.1)


def test_a_section_of_the_same_name_as_an_old_setting_is_taken_as_it_is():
    window = WindowConfig(length_frames=20)
    assert Config(window=window).window == window


def test_the_whole_configuration_of_a_run_of_0_1_gives_the_same_settings(caplog):
    before = Config(  # defaults of then that have changed
        tracking=TrackingConfig(rematch_px=6),
        intrinsics=IntrinsicsConfig(refine="no", focal_sigma=0.05),
    )
    assert read_config(V0_1 / "config.yaml") == before
    assert len(caplog.messages) > 10


def test_the_whole_file_of_the_tracker_of_0_1_gives_the_same_settings(caplog):
    assert read_config(V0_1 / "track.yaml") == Config()
    assert all("is now called localization." in text for text in caplog.messages)
