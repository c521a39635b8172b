"""A component: a factory with a name, an origin and parameters."""

from __future__ import annotations

import inspect
import os.path
import traceback
import typing
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from inspect import getdoc, isfunction, signature
from typing import Any, get_type_hints

import pydantic
from pydantic import BaseModel, ConfigDict, PydanticUserError, ValidationError, create_model
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from omnidrive.components.calls import call_fault
from omnidrive.components.documentation import plain_text
from omnidrive.components.entry_points import noun
from omnidrive.components.fields import field_names, field_type, plain
from omnidrive.components.parameters import Parameter, parameters_of
from omnidrive.errors import (
    PART_ERRORS,
    ComponentFailed,
    InvalidInput,
    OmnidriveError,
    one_line,
    suggestion,
)

_MAX_NESTED = 5  # names in deeper groups that a message suggests
_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
_FRAMES = 3  # calls shown of a traceback
_OTHER_CODE = (
    os.path.dirname(__file__),
    os.path.dirname(pydantic.__file__),
    typing.__file__,
    "<frozen",
    "<string>",
)
_FORMS = "f(), f(context) or f(context, parameters: ITS_PARAMETER_CLASS)"
_PLAIN_TYPES = (float, int, str, bool, "float", "int", "str", "bool")
"""Annotations of values, which are parameters and not a context."""
_METHODS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "controllers": {"reset": ("state",), "step": ("t", "state", "reference")},
    "plants": {"reset": ("pose",), "step": ("command", "dt"), "close": ()},
    "estimators": {"reset": ("pose",), "update": ("readings",)},
    "links": {"open": ("clock",), "read": (), "send": ("value",), "stop": (), "close": ()},
}
"""Methods of the product of a factory, by group, with the arguments of their calls."""


@dataclass(frozen=True, eq=False)
class Component:
    """A factory of controllers, plants, robots, maps, estimators, references or links.

    The factory is a class or a function that is called with no argument, with a context, or with a
    context and parameters. The context is that of its group, such as
    :class:`~omnidrive.control.ControllerContext`. The second argument is annotated with the class
    of the parameters: a dataclass or a pydantic model whose fields have types, defaults,
    :class:`~omnidrive.parameter.Bounds` and docstrings.

    Attributes:
        group: Group of the component.
        name: Name of the entry point or of the code.
        origin: Distribution and version, or file and its hash.
        factory: The class or function.
    """

    group: str
    name: str
    origin: str
    factory: Callable[..., Any]

    def __post_init__(self) -> None:
        """Check the methods of a class.

        Raises:
            InvalidInput: The class has not all methods of its group, or one of them takes other
                arguments than it is called with.
        """
        if not isinstance(self.factory, type) or hasattr(self.factory, "__getattr__"):
            return
        methods = _METHODS.get(self.group, {})
        missing = [name for name in methods if not hasattr(self.factory, name)]
        if missing:
            raise InvalidInput(
                f"the class {one_line(self.name)} is no {noun(self.group)}: it has no method "
                f"{' and no method '.join(missing)}"
            )
        for name, arguments in methods.items():
            method = inspect.getattr_static(self.factory, name)
            fault = call_fault(method, arguments, unbound=True) if isfunction(method) else ""
            if fault:
                raise InvalidInput(f"the class {one_line(self.name)}: {one_line(fault)}")

    @property
    def summary(self) -> str:
        """First line of the docstring of the factory, as Markdown."""
        return plain_text((getdoc(self.factory) or "").partition("\n")[0])

    @cached_property
    def parameter_class(self) -> type | None:
        """Class of the parameters; None: the component has none.

        Raises:
            InvalidInput: The factory has another signature, or an annotation without a meaning.
        """
        arguments = self._arguments
        if len(arguments) < 2:
            return None
        owner: Any = self.factory
        function = owner.__init__ if inspect.isclass(owner) else owner
        with self.guarded():
            hints = get_type_hints(function)
        found = hints.get(arguments[1].name)
        if not isinstance(found, type):
            raise InvalidInput(
                f"the argument '{arguments[1].name}' of {self.name} needs an annotation: the class "
                "of the parameters, a dataclass or a pydantic model"
            )
        return found

    @property
    def parameters(self) -> list[Parameter]:
        """Descriptions of the parameters."""
        with self.guarded():
            return parameters_of(self.parameter_class)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(field_names(self.parameter_class))

    @cached_property
    def parameter_model(self) -> type[BaseModel]:
        """Pydantic model whose only field ``parameters`` checks the parameters."""
        if self.parameter_class is None:
            return create_model("NoParameters", __config__=_STRICT, parameters=(_Nothing, ...))
        return create_model(
            "Parameters", __config__=_STRICT, parameters=(self.parameter_class, ...)
        )

    def parse(self, values: Mapping[str, Any]) -> Any:
        """Return the parameters with ``values``; None if the component has none.

        Raises:
            pydantic.ValidationError: A value is unknown, missing, of the wrong type or out of
                range.
            ComponentFailed: The class of the parameters raises another exception, or a field has a
                type that cannot be checked.
        """
        model: Any
        try:
            with self.guarded():
                model = self.parameter_model.model_validate({"parameters": dict(values)})
                if self.parameter_class is not None:  # also check the defaults
                    self.parameter_model.model_validate({"parameters": plain(model.parameters)})
        except ValidationError as error:
            details = [self._detail(problem) for problem in error.errors()]
            raise ValidationError.from_exception_data(self.name, details) from None
        return None if self.parameter_class is None else model.parameters

    def _detail(self, problem: ErrorDetails) -> InitErrorDetails:
        """Return an error of the parameters; that of an unknown one names the known ones."""
        loc = problem["loc"][1:]
        kind: str | PydanticCustomError = problem["type"]
        if kind in _UNKNOWN:
            group: Any = self.parameter_class
            for part in loc[:-1]:
                group = field_type(group, str(part)) if part in field_names(group) else None
            known = field_names(group)
            hint = suggestion(str(loc[-1]), known, maximum=30) if known else ""
            if nested := self._nested([str(part) for part in loc]):
                hint = f"; did you mean {' or '.join(nested)}?"
            text = f"has no parameter '{one_line(str(loc[-1]), 60)}'{hint}"
            loc = loc[:-1]
            kind = PydanticCustomError("component", "{text}", {"text": text})
        return InitErrorDetails(
            type=kind, loc=loc, input=problem["input"], ctx=problem.get("ctx", {})
        )

    def _nested(self, place: list[str]) -> list[str]:
        """Return the names, in deeper groups, of parameters and groups with the name of a place."""
        *groups, name = place
        start = len(groups)
        found = []
        for each in self.parameters:
            parts = each.name.split(".")
            if parts[:start] == groups and name in parts[start + 1 :]:
                found.append(".".join(parts[start : parts.index(name, start + 1) + 1]))
        return list(dict.fromkeys(found))[:_MAX_NESTED]

    def make(self, context: Any = None, parameters: Any = None) -> Any:
        """Return a new product of the factory.

        Args:
            context: Context of the group.
            parameters: Result of :meth:`parse`; None: the defaults.

        Raises:
            ComponentFailed: The factory raises an exception, other than one of this package, or
                exits.
        """
        arguments = (context, self.parse({}) if parameters is None else parameters)
        with self.guarded():
            return self.factory(*arguments[: len(self._arguments)])

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """Convert the exceptions of the component's code within the context.

        Raises:
            ComponentFailed: The code raises an exception, other than one of this package or one
                about a value, or exits.
        """
        try:
            yield
        except (OmnidriveError, ValidationError):
            raise
        except PART_ERRORS as error:
            raise ComponentFailed(
                f"the {noun(self.group)} '{self.name}' ({self.origin}) failed{failure_text(error)}"
            ) from error

    @cached_property
    def _arguments(self) -> list[inspect.Parameter]:
        """Arguments that the factory is called with."""
        try:
            arguments = [p for p in signature(self.factory).parameters.values() if _is_passed(p)]
        except ValueError as error:  # of some built-in classes
            raise self._uncallable(str(error)) from None
        if len(arguments) > 2:
            raise self._uncallable(f"its arguments are {', '.join(p.name for p in arguments)}")
        is_context = self.group != "maps"  # a reader of maps is called with a path
        if is_context and arguments and arguments[0].annotation in _PLAIN_TYPES:
            raise self._uncallable(f"its argument {arguments[0].name} is a plain value")
        return arguments

    def _uncallable(self, fact: str) -> InvalidInput:
        """Return the error about a factory with a wrong signature."""
        return InvalidInput(
            f"the component '{one_line(self.name)}' cannot be called: {fact}, need {_FORMS}"
        )


class UnreadComponent(Component):
    """A component by its name only, whose code was not imported; it cannot be made.

    Its parameters are a dictionary of the values as they are given.
    """

    @classmethod
    def named(cls, group: str, name: str) -> UnreadComponent:
        """Return the component of a name."""

        def factory() -> Any:
            """Refuse to make a product."""
            raise InvalidInput(
                f"the {noun(group)} '{one_line(name)}' is code that was not imported; read its "
                "file with --allow-code (in Python: allow_code=True)"
            )

        return cls(group, name, "code that was not imported", factory)

    @property
    def summary(self) -> str:
        """Empty: the code was not imported."""
        return ""

    def parse(self, values: Mapping[str, Any]) -> Any:
        """Return the values as they are."""
        return dict(values)


def failure_text(error: BaseException) -> str:
    """Return a colon, the innermost calls of the component's code and the exception, as text."""
    if isinstance(error, PydanticUserError):  # its other lines are advice to authors of models
        return f": its parameters cannot be checked: {error.message.splitlines()[0]}"
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith(_OTHER_CODE)
    ]
    calls = "".join(traceback.format_list(frames[-_FRAMES:])).rstrip()
    fact = "".join(traceback.format_exception_only(error)).strip()
    return f":\n{calls}\n{fact}" if calls else f": {fact}"


def _is_passed(argument: inspect.Parameter) -> bool:
    """Return whether a component passes an argument: one without default, or the parameters."""
    if argument.kind in {inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD}:
        return False
    return argument.default is inspect.Parameter.empty or argument.name in {"context", "parameters"}


class _Nothing(BaseModel):
    model_config = ConfigDict(extra="forbid")


_STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
