"""The reference of settings: whole, readable, and true of the code."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

import vgps
from vgps.config import Config, SettingsModel, read_config, setting_names
from vgps.config.gps import Region
from vgps.config.reference import all_settings, defaults_yaml, reference_text
from vgps.config.sentences import sentences

SETTINGS = {setting.name: setting for setting in all_settings()}


def models(model: type[SettingsModel] = Config) -> Iterator[type[SettingsModel]]:
    yield model
    for inner in model.sections().values():
        yield from models(inner)


def attributes_read() -> set[str]:
    """Names of all attributes that the code reads; of a setting's definition there is none."""
    sources = [file.read_text("utf-8") for file in Path(vgps.__file__).parent.rglob("*.py")]
    nodes = [node for source in sources for node in ast.walk(ast.parse(source))]
    return {node.attr for node in nodes if isinstance(node, ast.Attribute)}


def test_the_reference_lists_every_setting_once():
    text = reference_text().splitlines()
    for name in setting_names(Config):
        assert sum(line.startswith(f"{name}: ") for line in text) == 1, name


@pytest.mark.parametrize("model", [*models(), Region], ids=lambda model: model.__name__)
def test_every_setting_has_one_sentence(model):
    assert model.__doc__
    for name in set(model.model_fields) - set(model.sections()):
        words = sentences(model).get(name, "")
        assert words.endswith(".") and "\n\n" not in words, f"{name}: {words!r}"


@pytest.mark.parametrize("model", list(models()), ids=lambda model: model.__name__)
def test_basic_and_renamed_settings_exist(model):
    assert set(model.basic) <= set(model.model_fields)
    for name in model.renamed.values():
        inner = model
        for part in name.split("."):
            assert part in {*inner.model_fields, *inner.renamed}, name
            inner = inner.sections().get(part, inner)


@pytest.mark.slow
def test_the_code_reads_every_setting():
    read = attributes_read()
    unused = [name for name in setting_names(Config) if name.rpartition(".")[2] not in read]
    assert unused == []


@pytest.mark.slow
def test_the_printed_defaults_are_the_defaults(tmp_path, caplog):
    file = tmp_path / "defaults.yaml"
    file.write_text(defaults_yaml())
    assert read_config(file) == Config()
    assert caplog.messages == []
    given = yaml.safe_load(file.read_text())
    assert given == Config().model_dump(mode="json", exclude_none=True)


def test_basic_settings_come_first():
    keys = list(yaml.safe_load(defaults_yaml())["gps"])
    assert keys[:5] == ["model", "n", "error_model", "omega", "regions"]
    text = reference_text()
    assert text.index("gps.omega") < text.index("All other settings") < text.index("gps.min_sigma_m")


@pytest.mark.parametrize(
    ("name", "default", "kind"),
    [
        ("tracking.method", "lk", "lk | ssd"),
        ("tracking.inlier_px", "2.5", "number > 0, px"),
        ("tracking.min_inlier_share", "0.3", "number > 0 and < 1"),
        ("window.delay_frames", "11", "whole number >= 0, frames"),
        ("localization.max_landmarks", "120", "whole number > 0 and <= 2000"),
        ("localization.gyro_density_rad_s0p5", "0.0005", "number > 0, rad/s/sqrt(Hz)"),
        ("sensors.estimate_antenna", "false", "true | false"),
        ("online.blend_m_s", "1.0", "number > 0, m/s"),
        ("landmarks.min_view_difference", "0.1", "number >= 0"),
    ],
)
def test_default_and_kind_of_a_setting(name, default, kind):
    assert (SETTINGS[name].default, SETTINGS[name].kind) == (default, kind)


def test_regions_are_listed_class_by_class():
    assert SETTINGS["gps.regions"].default.startswith("rtk_fix, rtk_float")
    assert "rtk_float 2.4" in SETTINGS["gps.regions.<class>.r_m"].default
