"""YAML files from strangers: read within bounds, refused in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

_MAX_BYTES = 100_000


def read_yaml(path: Path, what: str, refusal: type[Exception]) -> Any:
    """The plain YAML value in ``path``: no more than 100 kB, without aliases.

    Args:
        path: The file, in UTF-8.
        what: What it should hold, for messages: "map", "scenario".
        refusal: Raised with one short line if the file cannot be read or is not such YAML.
    """
    name = one_line(str(path))
    try:
        with path.open("rb") as file:
            content = file.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise refusal(f"cannot read the {what} {name}: {reason}") from None
    if len(content) > _MAX_BYTES:
        raise refusal(f"{name} is too large for a YAML {what}")
    try:
        return yaml.load(content.decode("utf-8"), _Loader)
    except RecursionError:
        raise refusal(f"{name} is not a YAML {what}: it is nested too deeply") from None
    except Exception as error:  # PyYAML's constructors let errors of many kinds through
        reason = one_line(" ".join(str(error).split()), 200)
        raise refusal(f"{name} is not a YAML {what}: {reason}") from None


def shown(value: Any) -> str:
    """A value as messages show it: one line of at most 60 characters."""
    return one_line(repr(value), 60)


def one_line(text: str, limit: int = 300) -> str:
    """``text`` with everything unprintable escaped, cut to ``limit`` characters."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[: limit + 1])
    return line if len(line) <= limit else line[: limit - 3] + "..."


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
                        None, None, f"found the key {shown(key.value)} twice", key.start_mark
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
