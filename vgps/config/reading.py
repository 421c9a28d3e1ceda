"""Settings and surveys read from YAML files; what is wrong with one is a single line."""

import logging
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from vgps.config.base import SettingsModel, present_names
from vgps.config.gps import OffsetErrors, Region
from vgps.config.yaml_text import YamlTextError, parse_yaml
from vgps.errors import ConfigError
from vgps.model import FixClass

Settings = TypeVar("Settings", bound=SettingsModel)

log = logging.getLogger(__name__)

_MEMORY_KEYS = ("noise_m", "walk_m", "tail", "vertical")
_SPREADS = {"noise_m": "noise_spread", "walk_m": "walk_spread"}


def read_settings(path: Path, model: type[Settings]) -> Settings:
    """Return the defaults of a settings model, overridden by a YAML file.

    A warning names the present name of each setting that has an old one in the file.

    Raises:
        ConfigError: Not readable, an unknown key or an impossible value.
    """
    try:
        settings, notes = present_names(_read_yaml(path), model)
        found = model.model_validate(settings)
    except PydanticCustomError as error:
        raise ConfigError(str(error), file=path, remedy="keep one of the two") from error
    except ValidationError as error:
        raise as_config_error(error, model, file=path) from error
    for text in notes:
        log.warning("%s: %s", path, text)
    return found


def read_survey(path: Path) -> dict[FixClass, Region]:
    """Return the regions r(p), h(p) per fix class from a survey file; other keys may stand beside them.

    Raises:
        ConfigError: Not readable, no known class, or impossible sizes.
    """
    regions: dict[FixClass, Region] = {}
    for name, value in _read_yaml(path).items():
        if name not in set(FixClass) or not isinstance(value, dict):
            continue
        sizes = {key: value[key] for key in Region.model_fields if key in value}
        try:
            regions[FixClass(name)] = Region.model_validate(sizes)
        except ValidationError as error:
            raise as_config_error(error, Region, (name,), path) from error
    if not regions:
        known = ", ".join(FixClass)
        raise ConfigError("no fix class in it", file=path, expected=f"one of {known}, each with r_m and h_m")
    return regions


def read_survey_memory(
    path: Path, classes: Mapping[FixClass, OffsetErrors], spread: float
) -> dict[FixClass, OffsetErrors]:
    """Return the errors with memory of each class, with the keys that a survey file has for it.

    Args:
        path: A file that :func:`read_survey` reads.
        classes: Errors where the file has none.
        spread: Standard deviation of the log of a noise or walk that the file has.

    Raises:
        ConfigError: Not readable, or impossible numbers.
    """
    found = dict(classes)
    for name, value in _read_yaml(path).items():
        if name not in set(FixClass) or not isinstance(value, dict):
            continue
        keys = {key: value[key] for key in _MEMORY_KEYS if key in value}
        keys |= {known: spread for key, known in _SPREADS.items() if key in value}
        before = classes.get(FixClass(name), OffsetErrors()).model_dump()
        try:
            found[FixClass(name)] = OffsetErrors.model_validate(before | keys)
        except ValidationError as error:
            raise as_config_error(error, OffsetErrors, (name,), path) from error
    return found


def as_config_error(
    error: ValidationError,
    model: type[SettingsModel],
    place: tuple[str, ...] = (),
    file: Path | None = None,
) -> ConfigError:
    """Return the first of pydantic's errors as one line: the key, what was found, what was expected.

    Args:
        error: What pydantic found.
        model: The settings, whose names are suggested instead of an unknown key.
        place: Where in the file the settings stand.
        file: The file, if there is one.
    """
    first = error.errors()[0]
    key = ".".join(str(part) for part in (*place, *first["loc"]))
    if first["type"] == "extra_forbidden":
        return ConfigError("unknown key", file=file, place=f"key {key}", remedy=_correction(key, model))
    if first["type"] == "missing":
        return ConfigError("is missing", file=file, place=f"key {key}")
    if first["type"] == "value_error":
        return ConfigError(str(first["ctx"]["error"]), file=file, place=f"key {key}")
    expected = first["msg"].removeprefix("Input should be ")
    found = f"found {first['input']!r}"[:80]
    return ConfigError(found, file=file, place=f"key {key}", expected=expected[:1].lower() + expected[1:])


def setting_names(model: type[SettingsModel], place: str = "") -> Iterator[str]:
    """Yield the dotted names of all settings of a model."""
    sections = model.sections()
    for name in model.model_fields:
        if name in sections:
            yield from setting_names(sections[name], f"{place}{name}.")
        else:
            yield f"{place}{name}"


def _read_yaml(path: Path) -> Mapping[str, Any]:
    try:
        data = parse_yaml(path.read_bytes())
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path, expected="a YAML file") from error
    except YamlTextError as error:
        place = f"line {error.line}" if error.line else None
        raise ConfigError(f"not YAML ({error.problem})", file=path, place=place) from error
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise ConfigError(f"found a {type(data).__name__}", file=path, expected="a mapping of keys to values")
    return data


def _correction(key: str, model: type[SettingsModel]) -> str:
    """Return what to do about an unknown key: which settings or section may be meant."""
    names = set(setting_names(model))
    names |= {name.rpartition(".")[0] for name in names} - {""}
    section, _, last = key.rpartition(".")
    beside = {name.rpartition(".")[2]: name for name in names if name.rpartition(".")[0] == section}
    close = [beside[name] for name in get_close_matches(last, beside, 1)]
    elsewhere = sorted(name for name in names if name.rpartition(".")[2] == last)
    if guesses := close or elsewhere or get_close_matches(key, names, 1):
        return f"did you mean {' or '.join(guesses)}?"
    return "remove it or correct its spelling; vgps config lists all settings"
