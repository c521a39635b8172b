"""Arguments of the public functions: names of a fixed set, and paths.

Every public function is called with an unknown name for each argument that is one of a set of
names, and with an ``os.PathLike`` for each path. It runs in a process of its own, because the type
checks of the tests would reject the calls before the functions do.
"""

import inspect
import json
import os
import pathlib
import pkgutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import FunctionType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import pytest

import omnidrive
from omnidrive.control.pid import gain_tuning_system
from omnidrive.control.pid.rules import paper_rules
from omnidrive.errors import InvalidInput

RESULTS = {
    "FootprintPlan", "MinimumTime", "Plan", "Publisher", "RequiredLimit", "Study", "Subscription",
    "WaypointMotion",
}  # fmt: skip
"""Classes whose objects are results, which users do not make."""
EXTRAS = {"omnidrive.cli", "omnidrive.gym"}
SYSTEM = gain_tuning_system(paper_rules())
OTHERS: dict[str, dict[str, Any]] = {
    "omnidrive.film": {"path": "a.gif"},
    "omnidrive.run_study": {
        "study": omnidrive.paper_scenario().with_values(tasks={"track": {"durations": [1.0]}})
    },
    "omnidrive.MujocoPlant": {"robot": omnidrive.named_robot("small")},
    "omnidrive.fuzzy.FuzzySystem": {
        each.name: getattr(SYSTEM, each.name) for each in fields(SYSTEM)
    },
    "omnidrive.fuzzy.Inference": {"system": SYSTEM},
    "omnidrive.fuzzy.OutputVariable": {
        each.name: getattr(SYSTEM.outputs[0], each.name) for each in fields(SYSTEM.outputs[0])
    },
}
"""Arguments that a function needs before it can check a name or a path."""


class Asked:
    """Path that remembers whether a function read it."""

    def __init__(self, folder: str) -> None:
        self.folder, self.asked = folder, False

    def __fspath__(self) -> str:
        self.asked = True
        return os.path.join(self.folder, "new")


def public_functions() -> Iterator[tuple[str, Any, Any]]:
    """Yield name, function and, for methods, class of everything that a package exports."""
    names = [
        "omnidrive",
        *(m.name for m in pkgutil.walk_packages(omnidrive.__path__, "omnidrive.") if m.ispkg),
    ]
    seen = set()
    for package in names:
        if any(package.startswith(extra) for extra in EXTRAS):
            continue
        module = import_module(package)
        for name in getattr(module, "__all__", ()):
            thing = getattr(module, name)
            if id(thing) in seen or name in RESULTS or inspect.isabstract(thing):
                continue
            seen.add(id(thing))
            if isinstance(thing, FunctionType):
                yield f"{package}.{name}", thing, None
            elif isinstance(thing, type) and thing.__module__.startswith("omnidrive"):
                if is_dataclass(thing) or "__init__" in vars(thing):
                    yield f"{package}.{name}", thing.__init__, thing
                for method, function in vars(thing).items():
                    if isinstance(function, FunctionType) and not method.startswith("_"):
                        yield f"{package}.{name}.{method}", function, thing


def parts(hint: Any) -> Iterator[Any]:
    """Yield the types of a union, without annotations."""
    if get_origin(hint) is Annotated:
        yield from parts(get_args(hint)[0])
    elif get_origin(hint) in (Union, UnionType):
        for part in get_args(hint):
            yield from parts(part)
    else:
        yield hint


def arguments(function: Any) -> Iterator[tuple[str, list[Any]]]:
    """Yield name and types of each argument whose annotation can be evaluated."""
    for argument in inspect.signature(function).parameters.values():
        hint = argument.annotation
        if isinstance(hint, str):
            try:
                hint = eval(hint, inspect.unwrap(function).__globals__)
            except NameError:  # a name for type checkers only
                continue
        yield argument.name, list(parts(hint))


def names_in(types: list[Any]) -> list[str]:
    """Return the names in the types ``Literal["name", ...]``."""
    return [n for t in types if get_origin(t) is Literal for n in get_args(t) if isinstance(n, str)]


def call(function: Any, owner: Any, **given: Any) -> None:
    """Call a function with a valid name or None for the other arguments without default."""
    needed = {
        argument.name
        for argument in inspect.signature(function).parameters.values()
        if argument.default is inspect.Parameter.empty
        and argument.kind not in (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    }
    valid = {name: (names_in(types) or [None])[0] for name, types in arguments(function)}
    given = {name: valid.get(name) for name in needed} | given
    if owner is not None:
        given["self"] = object.__new__(owner)
    found = function(**given)
    if isinstance(found, Iterator):
        next(found)


def unchecked_names() -> tuple[int, list[str]]:
    """Return the number of arguments that are names, and those that are not checked."""
    count, unchecked = 0, []
    for where, function, owner in public_functions():
        for argument, types in arguments(function):
            names = names_in(types)
            if not names:
                continue
            count += 1
            unknown, others = names[0] + "x", OTHERS.get(where, {})
            try:
                call(function, owner, **(others | {argument: unknown}))
            except InvalidInput as error:
                if unknown in str(error) and f"did you mean '{names[0]}'" in str(error):
                    continue
                unchecked.append(f"{where}({argument}=): {error}")
            except Exception as error:
                unchecked.append(f"{where}({argument}=): {error!r}")
            else:
                unchecked.append(f"{where}({argument}=): no error")
    return count, unchecked


def unread_paths() -> tuple[int, list[str]]:
    """Return the number of arguments that are paths, and those for which str does not do."""
    count, unread = 0, []
    for where, function, owner in public_functions():
        for argument, types in arguments(function):
            classes = [get_origin(t) or t for t in types]
            if not {pathlib.Path, os.PathLike} & set(classes):
                continue
            count += 1
            with tempfile.TemporaryDirectory() as folder:
                path = Asked(folder)
                with suppress(Exception):
                    call(function, owner, **(OTHERS.get(where, {}) | {argument: path}))
            if not path.asked or str not in classes or os.PathLike not in classes:
                unread.append(f"{where}({argument}=)")
    return count, unread


@pytest.fixture(scope="module")
def found() -> dict[str, tuple[int, list[str]]]:
    """Return what the program below finds."""
    done = subprocess.run(
        [sys.executable, __file__], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_unknown_names_are_errors_with_the_nearest_name(found):
    count, unchecked = found["names"]
    assert unchecked == []
    assert count >= 20


def test_paths_are_str_or_path(found):
    count, unread = found["paths"]
    assert unread == []
    assert count >= 20


if __name__ == "__main__":
    print(json.dumps({"paths": unread_paths(), "names": unchecked_names()}))
