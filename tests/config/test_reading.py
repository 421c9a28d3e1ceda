import pytest
import yaml
from pydantic import ValidationError

from vgps.config import Config, OutlierConfig, read_config, read_survey
from vgps.errors import ConfigError
from vgps.model import FixClass


def written(path, text):
    path.write_text(text)
    return path


def test_a_file_overrides_what_it_names_and_nothing_else(tmp_path):
    found = read_config(written(tmp_path / "c.yaml", "gps: {n: 8}\nseed: 7\n"))
    assert (found.gps.n, found.seed) == (8, 7)
    assert found.gps.omega == Config().gps.omega and found.tracking == Config().tracking


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


def test_an_empty_file_and_none_are_the_defaults(tmp_path):
    assert read_config(written(tmp_path / "c.yaml", "")) == read_config(None) == Config()


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(ConfigError, match="No such file"):
        read_config(tmp_path / "none.yaml")


def test_a_survey_gives_the_regions_of_the_classes_it_names(tmp_path):
    file = written(tmp_path / "s.yaml", "rtk_fix: {r_m: 0.02, h_m: 0.03, epochs: 9}\nsurvey: {drop: 0.05}\n")
    config = Config().with_gps(None, file)
    assert set(config.gps.regions) == {FixClass.RTK_FIX} and config.gps.regions[FixClass.RTK_FIX].h_m == 0.03


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
