"""Components with parameters, as values in scenarios."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter
from pydantic_core import CoreSchema, core_schema

from omnidrive.components.code import CodePermission, allow
from omnidrive.components.component import Component, UnreadComponent
from omnidrive.components.entry_points import Group, component_names
from omnidrive.components.fields import plain
from omnidrive.components.registry import find_component
from omnidrive.errors import InvalidInput, MissingExtra, short_repr

_OBJECT = "Python object"  # origin of a component that was not found by a name
ALLOW_CODE = "allow_code"
"""Key of pydantic's validation context: whether code that is not installed may be imported.

Readers of files always set it. Without it, a Python program states the values, and names the code
itself."""


@dataclass(frozen=True, eq=False)
class Configured:
    """A component and its parameters.

    Two are equal if their types and parameters are. A pickle holds names and values only; the code
    is imported again where it is loaded.

    Attributes:
        component: The component.
        parameters: Instance of its parameter class; None if it has no parameters.
    """

    component: Component
    parameters: Any = None

    @property
    def type(self) -> str:
        """Name of the component."""
        return self.component.name

    @property
    def values(self) -> dict[str, Any]:
        """Parameters as dictionaries, lists, numbers and strings."""
        values: dict[str, Any] = {} if self.parameters is None else plain(self.parameters)
        return values

    @property
    def changes(self) -> dict[str, Any]:
        """Values that differ from the defaults, those of nested classes as ``group.name``."""
        defaults = {each.name: plain(each.default) for each in self.component.parameters}
        values = _flat(self.values)
        return {name: value for name, value in values.items() if value != defaults.get(name, ...)}

    def plain(self) -> dict[str, Any]:
        """Return the value of a scenario that describes the component."""
        return {"type": self.type, **self.values}

    def make(self, context: Any = None) -> Any:
        """Return a new product of the component; ``context`` is that of its group."""
        return self.component.make(context, self.parameters)

    def with_values(self, **values: Any) -> Configured:
        """Return the component with other values of some parameters.

        Raises:
            pydantic.ValidationError: A value is invalid.
        """
        return Configured(self.component, self.component.parse(self.values | values))

    def resolved(self, preset: str) -> Configured:
        """Return the component with the values that it uses with a preset of a scenario.

        A class of parameters whose defaults depend on the preset has a method ``resolved(preset)``,
        which returns the parameters with all values.

        Raises:
            InvalidInput: A parameter does not belong to the preset.
            ComponentFailed: The method raises another exception.
        """
        resolve = getattr(self.parameters, "resolved", None)
        if not callable(resolve):
            return self
        with self.component.guarded():
            return Configured(self.component, resolve(preset))

    def has_parameter(self, name: str) -> bool:
        """Return whether the component has a parameter ``name``."""
        return name in {*self.component.parameter_names, *self.values}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Configured):
            return NotImplemented
        mine, theirs = self.component, other.component
        return (mine.group, mine.name, self.values) == (theirs.group, theirs.name, other.values)

    __hash__ = None  # type: ignore[assignment]

    @property
    def is_importable(self) -> bool:
        """Whether another process can import the code; not if it was typed into a session."""
        module = sys.modules.get(self.component.factory.__module__)
        return self.component.origin != _OBJECT or hasattr(module, "__file__")

    def __reduce__(self) -> tuple[Any, ...]:
        component = self.component
        if component.origin == _OBJECT:
            return _configure_object, (component.group, component.factory, self.values)
        again = _unread if isinstance(component, UnreadComponent) else configure
        return again, (component.group, component.name, self.values)


def configure(
    group: Group,
    name: str,
    values: Mapping[str, Any] | None = None,
    *,
    allow_code: bool | CodePermission = True,
) -> Configured:
    """Return a component with parameters.

    Args:
        group: Group of the component.
        name: Name of the component, see :func:`find_component`.
        values: Values of parameters; the others have their defaults.
        allow_code: Whether code that is not installed may be imported; False for a name in a file.

    Raises:
        InvalidInput: There is no such component, or it cannot be imported.
        pydantic.ValidationError: A parameter is unknown, or its value is invalid.
    """
    component = find_component(group, name, allow_code=allow_code)
    return Configured(component, component.parse(values or {}))


def _unread(group: Group, name: str, values: Mapping[str, Any]) -> Configured:
    """Return a component whose code is not imported."""
    return configure(group, name, values, allow_code=CodePermission.UNREAD)


def _configure_object(group: str, factory: Any, values: Mapping[str, Any]) -> Configured:
    """Return a component whose factory is a Python object, not a name."""
    name = f"{factory.__module__}:{getattr(factory, '__qualname__', repr(factory))}"
    allow({name})  # the code is there already
    component = Component(group, name, _OBJECT, factory)
    return Configured(component, component.parse(values))


def permission_in(info: Any, default: bool = True) -> CodePermission:
    """Return the permission in pydantic's ``info`` of a validation."""
    return CodePermission.of((info.context or {}).get(ALLOW_CODE, default))


class OfGroup(NamedTuple):
    """Annotation of a field of type :class:`Configured` that names its group.

    Valid values are a name, or a mapping with the key ``type`` and the parameters. In Python, the
    type may also be a class or function itself, and the value the parameters of the default type.
    """

    group: Group
    default: str | None = None
    """Type of a mapping without the key ``type``; None: the key is needed."""

    def check(self, value: Any, info: Any) -> Configured:
        """Return the component that ``value`` describes; ``info`` is pydantic's."""
        if isinstance(value, Configured):
            return value
        if self.default is not None:
            component = find_component(self.group, self.default)
            if isinstance(value, component.parameter_class or ()):
                return Configured(component, component.parse(plain(value)))
        if isinstance(value, str) or callable(value):
            value = {"type": value}
        if not isinstance(value, dict):
            raise ValueError(f"must be a name or a mapping with 'type', got {short_repr(value)}")  # noqa: TRY004
        values = dict(value)
        odd = [key for key in values if not isinstance(key, str)]
        if odd:
            raise ValueError(f"has the unknown key {short_repr(odd[0])}")
        name = values.pop("type", self.default)
        if not (isinstance(name, str) or callable(name)):
            raise ValueError("needs 'type', the name of a component")  # noqa: TRY004
        try:
            if not isinstance(name, str):
                return _configure_object(self.group, name, values)
            return configure(self.group, name, values, allow_code=permission_in(info))
        except (InvalidInput, MissingExtra) as error:
            raise ValueError(str(error)) from None

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema by which pydantic checks a value."""
        return core_schema.with_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON schema: a name, or ``type`` and the parameters; or code by its name."""
        code = {"type": "string", "pattern": ":"}
        options = []
        for name in component_names(self.group):
            with suppress(InvalidInput, MissingExtra):  # it cannot be imported
                options.append(self._json_schema(name, handler))
        other = {"type": "object", "properties": {"type": code}, "required": ["type"]}
        return {"anyOf": [{"enum": list(component_names(self.group))}, code, *options, other]}

    def _json_schema(self, name: str, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the JSON schema of ``type`` and the parameters of one component."""
        component = find_component(self.group, name)
        kind = component.parameter_class
        with component.guarded():
            found = handler(TypeAdapter(kind).core_schema) if kind else {}
        options = handler.resolve_ref_schema(found) if found else {}
        parameters: dict[str, Any] = next(
            (each for each in (options, *options.get("anyOf", ())) if "properties" in each), {}
        )
        return {
            "type": "object",
            "description": component.summary,
            "properties": {"type": {"const": name}, **parameters.get("properties", {})},
            "required": [
                *(() if name == self.default else ("type",)), *parameters.get("required", ()),
            ],
            "additionalProperties": False,
        }  # fmt: skip


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested values by ``group.name``."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        inner = isinstance(value, dict)
        found |= _flat(value, f"{prefix}{name}.") if inner else {prefix + name: value}
    return found
