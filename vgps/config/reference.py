"""The reference of all settings, taken from the models themselves: as text, and as YAML of all defaults."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

import yaml
from pydantic.fields import FieldInfo

from vgps.config.base import SettingsModel
from vgps.config.root import Config
from vgps.config.sentences import sentences

_WIDTH = 100
_UNITS = {
    "_m_s": "m/s",
    "_deg_s": "deg/s",
    "_rad_s": "rad/s",
    "_px": "px",
    "_deg": "deg",
    "_frames": "frames",
    "_mb": "MB",
    "_sigmas": "sigmas",
    "_s": "s",
    "_m": "m",
}
_BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One setting of the reference.

    Attributes:
        name: Dotted, as ``gps.omega``; ``<class>`` stands for any fix class.
        default: As YAML has it.
        kind: What it may be, with its unit: ``number > 0, px``.
        sentence: What it does.
        basic: Whether a user is likely to change it.
    """

    name: str
    default: str
    kind: str
    sentence: str
    basic: bool


def all_settings(settings: SettingsModel | None = None, place: str = "") -> Iterator[Setting]:
    """Yield all settings with their defaults, section by section; of each section the basic ones first.

    Args:
        settings: The defaults; those of :class:`Config` if none are given.
        place: Prefix of the names, as ``gps.``.
    """
    settings = settings or Config()
    inner = settings.sections()
    for name in _basic_first(settings):
        if name not in inner:
            yield from _of_field(settings, name, place)
    for name in inner:
        yield from all_settings(getattr(settings, name), f"{place}{name}.")


def reference_text() -> str:
    """Return every setting with its default, what it may be, and its sentence; basic settings first."""
    settings = list(all_settings())
    basic = [line for setting in settings if setting.basic for line in _as_text(setting)]
    others = [line for setting in settings if not setting.basic for line in _as_text(setting)]
    return "\n".join(["Basic settings", "", *basic, "", "All other settings", "", *others]) + "\n"


def defaults_yaml() -> str:
    """Return all defaults as a commented file for ``--config``; in each section the basic settings first."""
    head = "# All settings of vgps with their defaults. A file for --config needs only those that differ."
    return "\n".join([head, "", *_section_yaml(Config(), "")]) + "\n"


def _as_text(setting: Setting) -> list[str]:
    sentence = textwrap.wrap(setting.sentence, _WIDTH, initial_indent="    ", subsequent_indent="    ")
    return [f"{setting.name}: {setting.default}   ({setting.kind})", *sentence]


def _section_yaml(settings: SettingsModel, indent: str) -> Iterator[str]:
    """Yield the lines of a section: basic settings, further settings, and the sections within it."""
    inner = settings.sections()
    plain = [name for name in _basic_first(settings) if name not in inner]
    further = next((name for name in plain if name not in settings.basic), None)
    for name in plain:
        if settings.basic and name == further:
            yield from ("", f"{indent}# Further settings:")
        yield from _field_yaml(settings, name, indent)
    for name in sorted(inner, key=lambda name: not inner[name].basic):
        yield ""
        yield from _comment(inner[name].__doc__, indent)
        yield f"{indent}{name}:"
        yield from _section_yaml(getattr(settings, name), f"{indent}  ")


def _field_yaml(settings: SettingsModel, name: str, indent: str) -> Iterator[str]:
    value, field = getattr(settings, name), type(settings).model_fields[name]
    yield from _comment(sentences(type(settings))[name], indent)
    if isinstance(value, dict):
        yield f"{indent}{name}:"
        yield from (f"{indent}  {key}: {_as_yaml(part)}" for key, part in value.items())
    else:
        yield f"{indent}{name}: {_as_yaml(value)}  # {_kind(name, field)}"


def _of_field(settings: SettingsModel, name: str, place: str) -> Iterator[Setting]:
    """Yield the setting of a field; of a mapping of fix classes one for each field of its values too."""
    value, field = getattr(settings, name), type(settings).model_fields[name]
    basic = name in settings.basic
    default = ", ".join(value) if isinstance(value, dict) else _as_yaml(value)
    yield _setting(type(settings), name, place, default, basic)
    if isinstance(value, dict):
        model = get_args(field.annotation)[1]
        for inner in model.model_fields:
            given = {key: getattr(part, inner) for key, part in value.items()}
            each = ", ".join(f"{key} {_as_yaml(one)}" for key, one in given.items() if one is not None)
            yield _setting(model, inner, f"{place}{name}.<class>.", each or "not set", basic)


def _setting(model: type[SettingsModel], name: str, place: str, default: str, basic: bool) -> Setting:
    return Setting(
        name=f"{place}{name}",
        default=default,
        kind=_kind(name, model.model_fields[name]),
        sentence=_sentence(sentences(model)[name]),
        basic=basic,
    )


def _basic_first(settings: SettingsModel) -> Sequence[str]:
    return sorted(type(settings).model_fields, key=lambda name: name not in settings.basic)


def _kind(name: str, field: FieldInfo) -> str:
    """Return what a setting may be, and its unit."""
    kind = field.annotation
    if get_origin(kind) is Literal:
        return " | ".join(str(choice) for choice in get_args(kind))
    if kind is bool:
        return "true | false"
    if get_origin(kind) is dict:
        return "mapping of fix classes"
    number = "whole number" if kind is int else "number"
    limits = [
        f"{sign} {getattr(bound, name):g}"
        for name, sign in _BOUNDS.items()
        for bound in field.metadata
        if hasattr(bound, name)
    ]
    parts = (number, " and ".join(limits))
    return ", ".join(part for part in (" ".join(filter(None, parts)), _unit(name, field)) if part)


def _unit(name: str, field: FieldInfo) -> str:
    extra = field.json_schema_extra
    if isinstance(extra, dict) and "unit" in extra:
        return str(extra["unit"])
    return next((unit for suffix, unit in _UNITS.items() if name.endswith(suffix)), "")


def _sentence(text: str | None) -> str:
    return " ".join((text or "").split())


def _comment(text: str | None, indent: str) -> list[str]:
    start = f"{indent}# "
    return textwrap.wrap(_sentence(text), _WIDTH, initial_indent=start, subsequent_indent=start)


def _as_yaml(value: Any) -> str:
    """Return a value on one line of YAML."""
    if isinstance(value, SettingsModel):
        value = value.model_dump(mode="json", exclude_none=True)
    text = yaml.safe_dump(value, default_flow_style=True, width=1000, sort_keys=False)
    return text.removesuffix("...\n").strip()
