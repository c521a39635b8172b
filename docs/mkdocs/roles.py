"""Docstrings for Markdown: roles such as :class:`~a.b.C` become the name in code style."""

import re

import griffe

_ROLE = re.compile(r":(?:py:)?[a-z]+:`~?([^`]+)`")


class Roles(griffe.Extension):
    """Rewrites the docstring of every object."""

    def on_object(self, *, obj, **kwargs):
        if not obj.is_alias and obj.docstring:
            obj.docstring.value = _ROLE.sub(_code, obj.docstring.value)


def _code(match):
    name = match[1]
    return f"`{name.rsplit('.', 1)[-1] if match[0].count('~') else name}`"
