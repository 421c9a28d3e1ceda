"""YAML from strangers: plain data within bounds, and no key that is given twice.

PyYAML's safe loader executes nothing, but the last of two equal keys wins silently, an alias of an alias of a
list may stand for more values than any memory holds, and brackets exhaust the stack.
"""

from collections.abc import Hashable
from typing import Any

import yaml

_LONGEST = 100_000  # characters; a calibration or a file of all settings has some thousands
_DEEPEST = 50
_MOST_VALUES = 50_000  # with those that aliases repeat
_LARGEST = 10**4000  # Python refuses to print integers not much longer


class YamlTextError(ValueError):
    """Text that is not YAML, or not plain data.

    Args:
        problem: What is wrong.
        line: Line of the text, from 1, if known.
    """

    def __init__(self, problem: str, line: int | None = None) -> None:
        self.problem, self.line = problem, line
        super().__init__(problem)


def parse_yaml(data: str | bytes) -> Any:
    """Return the value of a YAML text.

    Raises:
        YamlTextError: The text is not YAML, has a key twice in one mapping or an impossible date or number,
            or is absurdly long or nested, also by aliases.
    """
    if len(data) > _LONGEST:
        raise YamlTextError(f"{len(data)} characters of YAML, expected at most {_LONGEST}")
    try:
        return yaml.load(data, _Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        raise YamlTextError(error.problem or "unreadable", mark.line + 1 if mark else None) from error
    except yaml.YAMLError as error:  # bytes or characters that YAML does not have
        raise YamlTextError(getattr(error, "reason", None) or "unreadable") from error
    except (ValueError, OverflowError, TypeError, AttributeError, LookupError) as error:
        raise YamlTextError(str(error) or "unreadable") from error


class _Loader(yaml.SafeLoader):
    def __init__(self, stream: str | bytes) -> None:
        super().__init__(stream)
        self._depth = self._values = 0
        self._size: dict[yaml.Node, int] = {}  # values of each list or mapping that is complete

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        before = self._values
        if isinstance(event, yaml.AliasEvent) and event.anchor in self.anchors:
            size = self._size.get(self.anchors[event.anchor])
            if size is None:
                raise _refusal(f"alias *{event.anchor} within what it stands for", event)
            self._values += size
        self._depth += 1
        self._values += 1
        if self._depth > _DEEPEST or self._values > _MOST_VALUES:
            found = f"nested deeper than {_DEEPEST} levels" if self._depth > _DEEPEST else "too many values"
            raise _refusal(found, event)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if node is not None:
            self._size[node] = self._values - before
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        lines: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in lines:
                first = f"first on line {lines[key.value]}"
                raise _refusal(f"key {key.value} is given twice, {first}; keep one of the two", key)
            lines[key.value] = key.start_mark.line + 1
        return super().construct_mapping(node, deep)

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        value = int(super().construct_yaml_int(node))
        if abs(value) > _LARGEST:
            raise _refusal("an integer of more than 4000 digits", node)
        return value


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)


def _refusal(problem: str, where: Any) -> yaml.MarkedYAMLError:
    """Return the error to raise at an event or node."""
    return yaml.constructor.ConstructorError(None, None, problem, where.start_mark)
