"""Settings and surveys read from YAML files; what is wrong in one is a single line."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError

from vgps.config.base import SettingsModel
from vgps.config.gps import Region
from vgps.errors import ConfigError
from vgps.model import FixClass

Settings = TypeVar("Settings", bound=SettingsModel)


def read_settings(path: Path | None, kind: type[Settings]) -> Settings:
    """The defaults of a settings model, overridden by the YAML file at ``path`` if there is one.

    Raises:
        ConfigError: Not readable, an unknown key or an impossible value.
    """
    if path is None:
        return kind()
    try:
        return kind.model_validate(_read_yaml(path))
    except ValidationError as error:
        raise _as_config_error(error, path) from error


def read_survey(path: Path) -> dict[FixClass, Region]:
    """Regions r(p), h(p) per fix class from a survey file; other keys may stand beside them.

    Raises:
        ConfigError: Not readable, no known class, or impossible sizes.
    """
    regions: dict[FixClass, Region] = {}
    for name, value in _read_yaml(path).items():
        if name not in set(FixClass) or not isinstance(value, dict):
            continue
        sizes = {key: value[key] for key in ("r_m", "h_m", "correlation_s") if key in value}
        try:
            regions[FixClass(name)] = Region.model_validate(sizes)
        except ValidationError as error:
            raise _as_config_error(error, path) from error
    if not regions:
        known = ", ".join(FixClass)
        raise ConfigError("no fix class in it", file=path, expected=f"one of {known}, each with r_m and h_m")
    return regions


def _read_yaml(path: Path) -> Mapping[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path, expected="a YAML file") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"not YAML: {error}", file=path) from error
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise ConfigError(f"found a {type(data).__name__}", file=path, expected="a mapping of keys to values")
    return data


def _as_config_error(error: ValidationError, path: Path) -> ConfigError:
    first = error.errors()[0]
    place = "key " + ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        return ConfigError("unknown key", file=path, place=place, remedy="remove it or correct its spelling")
    found = f"found {first['input']!r}"[:80]
    return ConfigError(found, file=path, place=place, expected=first["msg"][:1].lower() + first["msg"][1:])
