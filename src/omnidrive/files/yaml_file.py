"""Untrusted YAML files: reading with limits and one-line error messages."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import yaml

from omnidrive.errors import one_line, short_repr
from omnidrive.files.bounded_file import read_bounded
from omnidrive.files.number_text import parse_number

_MAX_BYTES = 100_000
_MAX_DEPTH = 30
_NOTHING = {"", "~", "null", "Null", "NULL"}


def read_yaml(path: Path, kind: str, error_type: type[Exception]) -> Any:
    """Return the plain value in a YAML file of at most 100 kB without aliases.

    Values are mappings, lists, text, numbers, true, false and null. Only decimal numbers are
    numbers; ``1_000``, ``1:30``, ``010``, ``0x10`` and dates are text. Aliases, tags, duplicate
    keys and more than 30 levels of nesting are errors.

    Args:
        path: The file, in UTF-8.
        kind: Kind of the file for messages, such as "map" or "scenario".
        error_type: Type of the error raised, with a message of one line, if the file cannot be
            read or is not such YAML.
    """
    content = _content(path, kind, error_type, _MAX_BYTES)
    return parse_yaml(content, one_line(str(path)), kind, error_type)


def parse_yaml(content: bytes | str, name: str, kind: str, error_type: type[Exception]) -> Any:
    """Return the plain value in a text, as :func:`read_yaml`.

    Args:
        content: The text; bytes in UTF-8.
        name: Source of the text for messages.
        kind: Kind of the text for messages, see :func:`read_yaml`.
        error_type: Type of the errors, see :func:`read_yaml`.
    """
    try:
        return yaml.load(content.decode() if isinstance(content, bytes) else content, _Loader)
    except RecursionError:
        raise error_type(f"{name} is not a YAML {kind}: it is nested too deeply") from None
    except Exception as error:  # PyYAML's constructors raise errors of many types
        reason = one_line(" ".join(str(error).split()), 200)
        raise error_type(f"{name} is not a YAML {kind}: {reason}") from None


def read_yaml_documents(
    path: Path, kind: str, error_type: type[Exception], *, max_bytes: int
) -> list[Any]:
    """Return all documents of a long YAML file: mappings, lists, floats, text and None.

    Values are built from the events of the parser without PyYAML's node tree, about ten times as
    fast, and no other types are constructed. Aliases, tags, duplicate keys and more than 30 levels
    of nesting are errors.

    Args:
        path: The file, in UTF-8.
        kind: Kind of the file for messages, see :func:`read_yaml`.
        error_type: Type of the errors, see :func:`read_yaml`.
        max_bytes: Size limit in bytes.
    """
    content = _content(path, kind, error_type, max_bytes)
    try:
        return _documents(yaml.parse(content.decode("utf-8"), Loader=_PARSER))
    except (yaml.YAMLError, ValueError) as error:  # ValueError: not UTF-8
        fact = str(error)
        if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark:
            fact = f"line {error.problem_mark.line + 1}: {error.problem}"
        reason = one_line(" ".join(fact.split()), 200)
        raise error_type(f"{one_line(str(path))} is not a YAML {kind}: {reason}") from None


def _content(path: Path, kind: str, error_type: type[Exception], max_bytes: int) -> bytes:
    excess = f"is too large for a YAML {kind}"
    return read_bounded(path, max_bytes, kind, error_type, excess=excess)


def _documents(events: Iterable[yaml.Event]) -> list[Any]:
    """Build values from events; the stack holds the open collections and their items."""
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
        raise _refused(start, "a mapping has a list or a mapping as a key")
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
    if not event.implicit[0]:  # a quoted scalar
        return text
    if text in _NOTHING:
        return None
    number = parse_number(text)
    return text if number is None else number


def _refused(event: yaml.Event, fact: str) -> yaml.YAMLError:
    mark: Any = event.start_mark
    return yaml.MarkedYAMLError(problem=fact, problem_mark=mark)


# the C parser, if PyYAML was built with it, as the wheels are
_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(yaml.SafeLoader):
    """Loader of plain values without aliases, which can expand a short file enormously."""

    depth = 0
    """Number of open collections."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Raise YAMLError for an alias, a tag, or deep nesting."""
        peek: Callable[[], yaml.Event] = self.peek_event  # untyped in its stubs
        event: Any = peek()
        if isinstance(event, yaml.AliasEvent):
            raise _refused(event, "aliases (*name) are not allowed")
        if event.tag is not None:
            raise _refused(event, "tags (!name) are not allowed")
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise _refused(event, f"it is nested more than {_MAX_DEPTH} deep")
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Raise ConstructorError for a duplicate key; PyYAML would silently keep the last."""
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
        """Raise ConstructorError for an integer beyond the range of floats."""
        try:
            value: int = self.construct_yaml_int(node)
            float(value)
        except (OverflowError, ValueError):  # ValueError: more than 4300 digits
            raise yaml.constructor.ConstructorError(
                None, None, "found an integer beyond 1.8e308", node.start_mark
            ) from None
        return value


_INT, _FLOAT = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"
_KEPT = {f"tag:yaml.org,2002:{kind}" for kind in ("bool", "null")}  # not: dates, <<, =
_Loader.yaml_implicit_resolvers = {
    first: [each for each in pairs if each[0] in _KEPT]
    for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
# those of YAML 1.1 without underscores (1_000), sexagesimal (1:30), octal and hexadecimal numbers
_Loader.add_implicit_resolver(_INT, re.compile(r"[-+]?(0|[1-9][0-9]*)$"), list("-+0123456789"))
_Loader.add_implicit_resolver(
    _FLOAT,
    re.compile(
        r"([-+]?[0-9]+\.[0-9]*([eE][-+][0-9]+)?|\.[0-9]+([eE][-+][0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))$"
    ),
    list("-+0123456789."),
)
_Loader.add_constructor(_INT, _Loader.construct_number)
