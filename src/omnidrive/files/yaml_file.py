"""YAML files from strangers: read within bounds, refused in one line."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from omnidrive.files.bounded_file import one_line, read_bounded, short_repr

_MAX_BYTES = 100_000
_MAX_DEPTH = 30
_LONGEST_NUMBER = 40  # characters
_NOTHING = {"", "~", "null", "Null", "NULL"}


def read_yaml(path: Path, what: str, refusal: type[Exception]) -> Any:
    """The plain YAML value in ``path``: no more than 100 kB, without aliases.

    Args:
        path: The file, in UTF-8.
        what: What it should hold, for messages: "map", "scenario".
        refusal: Raised with one short line if the file cannot be read or is not such YAML.
    """
    content = _content(path, what, refusal, _MAX_BYTES)
    name = one_line(str(path))
    try:
        return yaml.load(content.decode("utf-8"), _Loader)
    except RecursionError:
        raise refusal(f"{name} is not a YAML {what}: it is nested too deeply") from None
    except Exception as error:  # PyYAML's constructors let errors of many kinds through
        reason = one_line(" ".join(str(error).split()), 200)
        raise refusal(f"{name} is not a YAML {what}: {reason}") from None


def read_yaml_documents(
    path: Path, what: str, refusal: type[Exception], *, max_bytes: int
) -> list[Any]:
    """Every document in a long YAML file: mappings, lists, numbers (all float), text and None.

    It follows the parser's events, without PyYAML's tree of nodes: about ten times as fast, and
    nothing is constructed but these five. Aliases, tags, keys that stand twice and more than 30
    levels are refused.

    Args:
        path: As for :func:`read_yaml`.
        what: As for :func:`read_yaml`.
        refusal: As for :func:`read_yaml`.
        max_bytes: Size of the largest file that is read.
    """
    content = _content(path, what, refusal, max_bytes)
    try:
        return _documents(yaml.parse(content.decode("utf-8"), Loader=_PARSER))
    except (yaml.YAMLError, ValueError) as error:  # ValueError: not UTF-8
        fact = str(error)
        if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark:
            fact = f"line {error.problem_mark.line + 1}: {error.problem}"
        reason = one_line(" ".join(fact.split()), 200)
        raise refusal(f"{one_line(str(path))} is not a YAML {what}: {reason}") from None


def _content(path: Path, what: str, refusal: type[Exception], max_bytes: int) -> bytes:
    excess = f"is too large for a YAML {what}"
    return read_bounded(path, max_bytes, what, refusal, excess=excess)


def _documents(events: Iterable[yaml.Event]) -> list[Any]:
    """Values from events; the stack holds each open document, list or mapping and what is in it."""
    documents: list[Any] = []
    stack: list[tuple[yaml.Event, list[Any]]] = []
    for event in events:
        if isinstance(event, yaml.ScalarEvent):
            stack[-1][1].append(_scalar(event))
        elif isinstance(event, yaml.CollectionStartEvent):
            if len(stack) > _MAX_DEPTH:
                raise _refused(event, f"it is nested more than {_MAX_DEPTH} deep")
            _check_tag(event)
            stack.append((event, []))
        elif isinstance(event, yaml.AliasEvent):
            raise _refused(event, "aliases (*name) are not allowed")
        elif isinstance(event, yaml.DocumentStartEvent):
            stack.append((event, []))
        elif isinstance(event, yaml.MappingEndEvent):
            mapping = _mapping(*stack.pop())
            stack[-1][1].append(mapping)
        elif isinstance(event, yaml.SequenceEndEvent):
            _, items = stack.pop()
            stack[-1][1].append(items)
        elif isinstance(event, yaml.DocumentEndEvent):
            documents += stack.pop()[1]
    return documents


def _check_tag(event: yaml.CollectionStartEvent | yaml.ScalarEvent) -> None:
    if event.tag is not None:
        raise _refused(event, "tags (!name) are not allowed")


def _mapping(start: yaml.Event, items: list[Any]) -> dict[Any, Any]:
    keys = items[::2]
    if any(isinstance(key, (list, dict)) for key in keys):
        raise _refused(start, "a mapping has a list or a mapping for a key")
    mapping = dict(zip(keys, items[1::2], strict=True))
    if len(mapping) < len(keys):
        seen: set[Any] = set()
        for key in keys:
            if key in seen:
                raise _refused(start, f"a mapping has the key {short_repr(key)} twice")
            seen.add(key)
    return mapping


def _scalar(event: yaml.ScalarEvent) -> str | float | None:
    text: str = event.value
    _check_tag(event)
    if not event.implicit[0]:  # it stands in quotes
        return text
    if text in _NOTHING:
        return None
    try:
        return float(text) if len(text) <= _LONGEST_NUMBER else text
    except ValueError:
        return text


def _refused(event: yaml.Event, fact: str) -> yaml.YAMLError:
    mark: Any = event.start_mark
    return yaml.MarkedYAMLError(problem=fact, problem_mark=mark)


# the parser in C, if PyYAML was built with it, as its wheels are
_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(yaml.SafeLoader):
    """YAML without aliases, which can make a short file enormous, and with finite numbers."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Refuse an alias."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not allowed")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Refuse a key that stands twice: PyYAML would silently keep the last."""
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"found the key {short_repr(key.value)} twice", key.start_mark
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)

    def construct_number(self, node: Any) -> int:
        """Refuse an integer that no float can hold."""
        value: int = self.construct_yaml_int(node)
        try:
            float(value)
        except OverflowError:
            raise yaml.constructor.ConstructorError(
                None, None, "found an integer beyond 1.8e308", node.start_mark
            ) from None
        return value


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_number)
