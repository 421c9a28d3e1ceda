from collections.abc import Mapping
from typing import ClassVar

import pytest
from pydantic import ValidationError

from vgps.config import Config, SettingsModel, present_names


class Engine(SettingsModel):
    renamed: ClassVar[Mapping[str, str]] = {"power": "power_w"}

    removed: ClassVar[Mapping[str, str]] = {"valves": "the engine has none"}

    power_w: float = 1.0
    """Power."""


class Car(SettingsModel):
    renamed: ClassVar[Mapping[str, str]] = {"motor": "engine", "watts": "engine.power_w", "engine": "kind"}

    engine: Engine = Engine()
    kind: str = "petrol"
    """What it burns."""


@pytest.mark.parametrize(
    ("old", "present", "notes"),
    [
        ({"engine": {"power_w": 2.0}}, {"engine": {"power_w": 2.0}}, []),
        (
            {"engine": {"power": 2.0}},
            {"engine": {"power_w": 2.0}},
            ["setting engine.power is now called engine.power_w"],
        ),
        ({"watts": 2.0}, {"engine": {"power_w": 2.0}}, ["setting watts is now called engine.power_w"]),
        (
            {"motor": {"power": 2.0}},
            {"engine": {"power_w": 2.0}},
            ["setting motor is now called engine", "setting engine.power is now called engine.power_w"],
        ),
        # the name of a section once was that of a plain setting
        ({"engine": "diesel"}, {"kind": "diesel"}, ["setting engine is now called kind"]),
        ({"engine": None}, {"engine": {}}, []),
        (
            {"engine": {"valves": 8, "power_w": 2.0}},
            {"engine": {"power_w": 2.0}},
            ["setting engine.valves has no effect any more: the engine has none"],
        ),
    ],
)
def test_old_names_become_present_ones_and_each_is_noted(old, present, notes):
    before = repr(old)
    assert present_names(old, Car) == (present, notes)
    assert repr(old) == before
    Car.model_validate(old)


def test_a_setting_under_both_its_names_is_refused():
    with pytest.raises(ValidationError, match=r"engine.power_w is also given under its old name watts"):
        Car.model_validate({"watts": 2.0, "engine": {"power_w": 3.0}})


def test_an_old_name_is_logged_as_a_warning(caplog):
    assert Car.model_validate({"watts": 2.0}).engine.power_w == 2.0
    assert caplog.messages == ["setting watts is now called engine.power_w"]


def test_sections_are_the_fields_that_are_settings_themselves():
    assert Car.sections() == {"engine": Engine}


def test_a_copy_refuses_settings_that_do_not_exist():
    config = Config()
    assert config.sensors.model_copy(update={"time_offset_s": 0.2}).time_offset_s == 0.2
    with pytest.raises(AttributeError, match="SensorsConfig has no setting lag_s"):
        config.sensors.model_copy(update={"lag_s": 0.2})
