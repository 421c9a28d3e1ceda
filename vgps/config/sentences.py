"""The sentences of settings, read from the source when they are shown: few commands show any."""

import ast
import inspect
import textwrap
from collections.abc import Mapping
from functools import cache
from itertools import pairwise

from vgps.config.base import SettingsModel


@cache
def sentences(model: type[SettingsModel]) -> Mapping[str, str]:
    """Return the docstring below each setting of a model, by the setting's name."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if issubclass(base, SettingsModel):
            found |= _of_class(base)
    return found


def _of_class(model: type[SettingsModel]) -> dict[str, str]:
    [definition] = ast.parse(textwrap.dedent(inspect.getsource(model))).body
    assert isinstance(definition, ast.ClassDef)
    return {
        field.target.id: inspect.cleandoc(below.value.value)
        for field, below in pairwise(definition.body)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        if isinstance(below.value.value, str)
    }
