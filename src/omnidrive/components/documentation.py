"""Documentation of the fields of parameter classes, read from their source code."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from inspect import cleandoc, getsource
from itertools import pairwise

from omnidrive.components.fields import field_names

_ROLE = re.compile(r":[a-z:]+:`[~.]?(?:[\w.]*\.)?(\w+)`")  # such as :class:`~omnidrive.Robot`
_NONE = re.compile(r"\bNone\b")  # Python's word; scenarios and options have null
_ENTRY = re.compile(r"    (\w+)(?: \([^)]*\))?: *(.*)")  # of a section `Attributes:`


def field_docs(cls: type) -> dict[str, str]:
    """Return the documentation of the fields of a class in Markdown, in the order of the fields.

    The documentation of a field is the string literal below it, else its entry in the section
    ``Attributes:`` of the docstring of the class; fields without documentation are left out.

    Args:
        cls: Dataclass, pydantic model or NamedTuple; fields of its base classes are included.
    """
    docs: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        docs |= _listed_attributes(base.__dict__.get("__doc__") or "")
        docs |= _literals(base.__module__).get(base.__qualname__, {})
    return {name: docs[name] for name in field_names(cls) if name in docs}


def plain_text(docstring: str) -> str:
    """Return the first paragraph of a docstring as one line of Markdown, with null for None."""
    first = cleandoc(docstring).split("\n\n")[0]
    text = _NONE.sub("null", _ROLE.sub(r"`\1`", first).replace("``", "`"))
    return " ".join(text.split())


def _listed_attributes(docstring: str) -> dict[str, str]:
    """Return the entries of the section ``Attributes:`` of a docstring of a class."""
    _, heading, section = f"\n{cleandoc(docstring)}".partition("\nAttributes:\n")
    found: dict[str, list[str]] = {}
    lines: list[str] = []
    for line in section.splitlines() if heading else []:
        if line and not line.startswith(" "):
            break
        entry = _ENTRY.fullmatch(line)
        if entry:
            lines = found.setdefault(entry[1], [])
        lines.append(entry[2] if entry else line)
    return {name: plain_text("\n".join(lines)) for name, lines in found.items()}


@cache
def _literals(module_name: str) -> Mapping[str, Mapping[str, str]]:
    """Return the strings below annotated names in the classes of a module, by qualified name."""
    try:
        source = getsource(sys.modules[module_name])
    except (KeyError, TypeError, OSError):  # a built-in module, or a class typed into a prompt
        return {}
    return dict(_classes(ast.parse(source).body))


def _classes(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the qualified name and the documented fields of each class of a block."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            name = prefix + node.name
            yield name, dict(_documented(node.body))
            yield from _classes(node.body, f"{name}.")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _classes(node.body, f"{prefix}{node.name}.<locals>.")


def _documented(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    for field, text in pairwise(body):
        match field, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(doc))),
            ):
                yield name, plain_text(doc)
