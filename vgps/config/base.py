"""The base of all settings: frozen, every field defaulted and documented, unknown keys refused.

Settings that were renamed or moved are read under their old names too, see `SettingsModel.renamed`.
"""

import logging
from collections.abc import Mapping
from typing import Any, ClassVar, Self, TypeGuard, get_args

from pydantic import BaseModel, ConfigDict, model_validator
from pydantic_core import PydanticCustomError

log = logging.getLogger(__name__)


class SettingsModel(BaseModel):
    """Base of all settings."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    renamed: ClassVar[Mapping[str, str]] = {}
    """Old name of a setting -> its present name, dotted where it moved into a section of this model."""

    removed: ClassVar[Mapping[str, str]] = {}
    """Name of a setting that is gone -> what decides instead; it is read and has no effect."""

    basic: ClassVar[tuple[str, ...]] = ()
    """Settings that a user is likely to change; the reference shows them first."""

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some settings changed; pydantic's own would take names that do not exist.

        Raises:
            AttributeError: There is no such setting.
        """
        unknown = set(update or ()) - set(type(self).model_fields)
        if unknown:
            raise AttributeError(f"{type(self).__name__} has no setting {', '.join(sorted(unknown))}")
        return super().model_copy(update=update, deep=deep)

    @classmethod
    def sections(cls) -> dict[str, "type[SettingsModel]"]:
        """Return the fields that are settings models themselves."""
        fields = cls.model_fields.items()
        return {name: field.annotation for name, field in fields if _is_settings_model(field.annotation)}

    @model_validator(mode="before")
    @classmethod
    def _accept_old_names(cls, settings: Any) -> Any:
        if not isinstance(settings, Mapping):
            return settings
        found, notes = present_names(settings, cls)
        for text in notes:
            log.warning("%s", text)
        return {key: cls._as_word(key, value) for key, value in found.items()}

    @classmethod
    def _as_word(cls, key: str, value: Any) -> Any:
        """Return yes or no where a setting has these words, which YAML reads as true and false."""
        field = cls.model_fields.get(key)
        words = get_args(field.annotation) if field is not None else ()
        if isinstance(value, bool) and {"yes", "no"} <= {word for word in words if isinstance(word, str)}:
            return "yes" if value else "no"
        return value


def present_names(
    settings: Mapping[str, Any], model: type[SettingsModel], place: str = ""
) -> tuple[dict[str, Any], list[str]]:
    """Return settings under their present names, and a line for each that had an old one or is gone.

    Sections without any key count as empty ones.

    Args:
        settings: Keys and values as they stand in a file; not changed.
        model: Whose settings they are.
        place: Prefix of the keys in messages, as ``sensors.``.

    Raises:
        PydanticCustomError: A setting is given under both its names.
    """
    old = {key: model.renamed[key] for key, value in settings.items() if _is_old(key, value, model)}
    found = {key: value for key, value in settings.items() if key not in old and key not in model.removed}
    notes = [
        f"setting {place}{key} has no effect any more: {model.removed[key]}"
        for key in settings
        if key in model.removed
    ]
    for key, name in old.items():
        if not _put(found, name, settings[key]):
            message = "setting {new} is also given under its old name {old}"
            raise PydanticCustomError("two_names", message, {"new": f"{place}{name}", "old": f"{place}{key}"})
        notes.append(f"setting {place}{key} is now called {place}{name}")
    for key, section in model.sections().items():
        if key in found and isinstance(found[key], Mapping | None):
            found[key], more = present_names(found[key] or {}, section, f"{place}{key}.")
            notes += more
    return found, notes


def _is_settings_model(kind: Any) -> TypeGuard[type[SettingsModel]]:
    return isinstance(kind, type) and issubclass(kind, SettingsModel)


def _is_old(key: str, value: Any, model: type[SettingsModel]) -> bool:
    """Whether a key is an old name; a section's name may be the old one of a plain value."""
    is_section = isinstance(value, Mapping | SettingsModel | None)
    return key in model.renamed and not (key in model.model_fields and is_section)


def _put(settings: dict[str, Any], name: str, value: Any) -> bool:
    """Set a setting by its dotted name; False if there is one already."""
    *parents, last = name.split(".")
    for parent in parents:
        inner = settings.get(parent) or {}
        settings[parent] = dict(inner) if isinstance(inner, Mapping) else {}
        settings = settings[parent]
    if last in settings:
        return False
    settings[last] = value
    return True
