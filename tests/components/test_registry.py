"""Finding components by name, and their parameters."""

import pickle
import re
import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from typing import Annotated

import pytest
from pydantic import BaseModel, ValidationError

import omnidrive as od
from omnidrive.cli.list import _try_to_find
from omnidrive.components import (
    component_names,
    configure,
    entry_points,
    find_component,
    parse_specification,
    registry,
)
from omnidrive.components.component import Component
from omnidrive.components.configured import Configured, OfGroup
from omnidrive.components.parameters import parameters_of
from omnidrive.control import FeedforwardController
from omnidrive.errors import ComponentFailed, InvalidInput, MissingExtra

LAW = """
from dataclasses import dataclass
import omnidrive as od

@dataclass
class Gains:
    gain: float = 2.0

class Law:
    '''A law.'''
    def __init__(self, context, parameters: Gains):
        self.parameters = parameters
    def reset(self, state): pass
    def step(self, t, state, reference):
        return od.Command(od.BodyTwist(0.0, 0.0, 0.0))
"""


@pytest.fixture
def law(tmp_path):
    path = tmp_path / "law.py"
    path.write_text(LAW)
    return f"{path}:Law"


def test_own_components_are_found():
    assert "holonomic-nmpc" in component_names("controllers")
    assert "planar" in component_names("plants")
    assert find_component("controllers", "pid").origin.startswith("omnidrive ")


def test_unknown_name_is_rejected_with_the_closest():
    with pytest.raises(InvalidInput, match="no controller 'holonomic-mpc'; did you mean 'holonomi"):
        find_component("controllers", "holonomic-mpc")


def test_file_is_imported_only_if_allowed(law):
    with pytest.raises(InvalidInput, match="is code that is not installed; if you trust it, allow"):
        find_component("controllers", law)
    component = find_component("controllers", law, allow_code=True)
    assert component.summary == "A law."
    assert "law.py, SHA-256" in component.origin
    assert component.make(None).parameters.gain == 2.0


def test_changed_file_is_imported_again(law, tmp_path):
    before = find_component("controllers", law, allow_code=True)
    assert find_component("controllers", law, allow_code=True).factory is before.factory
    (tmp_path / "law.py").write_text(LAW.replace("2.0", "3.0"))
    after = find_component("controllers", law, allow_code=True)
    assert after.make(None).parameters.gain == 3.0
    assert after.origin != before.origin


def test_failed_import_shows_where(tmp_path):
    (tmp_path / "law.py").write_text("import math\n\nx = math.sqrt(-1.0)\n")
    with pytest.raises(InvalidInput, match=r"(?s)cannot be imported.*law.py.*line 3.*ValueError"):
        find_component("controllers", f"{tmp_path}/law.py:Law", allow_code=True)
    (tmp_path / "law.py").write_text("def f(:\n")
    with pytest.raises(InvalidInput, match=r"(?s)cannot be imported.*SyntaxError") as caught:
        find_component("controllers", f"{tmp_path}/law.py:Law", allow_code=True)
    assert "registry.py" not in str(caught.value)
    calls = "".join(f"def f{k}(): f{k + 1}()\n" for k in range(9))
    (tmp_path / "law.py").write_text(f"{calls}def f9(): raise KeyError('gain')\nf0()\n")
    with pytest.raises(InvalidInput, match=r"KeyError: 'gain'") as caught:
        find_component("controllers", f"{tmp_path}/law.py:Law", allow_code=True)
    assert str(caught.value).count("law.py") == 1 + 3  # its name, and the innermost calls
    assert not [
        module for name, module in sys.modules.items()
        if name.startswith("omnidrive_code_") and module.__spec__.origin.startswith(str(tmp_path))
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("{path}/nothing.py:Law", "cannot read the controller"),
        ("a" * 300 + ".py:Law", "does not exist: the name of code is relative to the working"),
        ("a\0.py:Law", "does not exist: the name of code is relative to the working"),
        ("{path}/" + "a" * 300 + ".py:Law", "cannot read the controller .*: File name too long"),
        ("nothing.py", "needs the name of its class: FILE.py:NAME"),
        ("./a:Law", "is neither FILE.py:NAME nor MODULE:NAME"),
        ("{path}/law.py:Lwa", "does not exist; did you mean 'Law'"),
        ("no_such_module_x:Law", "cannot be imported.*No module named 'no_such_module_x'"),
        ("math:pi", "is not a class or function"),
    ],
)
def test_bad_code_names_are_rejected(law, tmp_path, name, message):
    with pytest.raises(InvalidInput, match=f"(?s){message}"):
        find_component("controllers", name.format(path=tmp_path), allow_code=True)


PARAMETERS = """
import sys
from dataclasses import dataclass, field

class Odd: pass

def fail(): raise RuntimeError("no default")

@dataclass
class Gains:
    gain: float = 2.0
    BODY

class Law:
    def __init__(self, context, parameters: Gains):
        EXIT
    def reset(self, state): pass
    def step(self, t, state, reference): pass
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("BODY", "odd: Odd = None", "its parameters cannot be checked: .*Odd"),
        ("BODY", "unknown: 'Missing' = 1", "its parameters cannot be checked: .*Missing"),
        ("BODY", "other: float = field(default_factory=fail)", "law.py.*RuntimeError: no default"),
        ("BODY", "def __post_init__(self): fail()", "law.py.*RuntimeError: no default"),
        (": Gains)", ": 'Missing')", "NameError: name 'Missing' is not defined"),
        ("EXIT", "sys.exit(0)", "law.py.*SystemExit: 0"),
    ],
)
def test_failing_code_of_a_component_is_named(tmp_path, old, new, message):
    assert old in PARAMETERS
    text = PARAMETERS.replace(old, new).replace("BODY", "").replace("EXIT", "pass")
    (tmp_path / "law.py").write_text(text)
    with pytest.raises(ComponentFailed, match=rf"(?s)the controller '.*law.py:Law'.*{message}"):
        configure("controllers", f"{tmp_path}/law.py:Law").make()


def test_component_that_cannot_be_described_is_listed_with_its_error(tmp_path, monkeypatch):
    text = PARAMETERS.replace("BODY", "other: float = field(default_factory=fail)")
    (tmp_path / "law.py").write_text(text.replace("EXIT", "pass"))
    component = find_component("controllers", f"{tmp_path}/law.py:Law", allow_code=True)
    monkeypatch.setattr("omnidrive.components.find_component", lambda *_: component)
    assert "RuntimeError: no default" in _try_to_find("controllers", "law")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import sys\nsys.exit(3)", "cannot be imported.*SystemExit: 3"),
        (
            "def __getattr__(name): raise RuntimeError(name)",
            "cannot be imported.*RuntimeError: Law",
        ),
        ("import sys\ndel sys.modules[__name__]\nclass Law: pass", "is no controller"),
    ],
)
def test_hostile_module_is_an_error(tmp_path, text, message):
    (tmp_path / "law.py").write_text(text)
    with pytest.raises(InvalidInput, match=f"(?s){message}"):
        find_component("controllers", f"{tmp_path}/law.py:Law", allow_code=True)


def test_name_of_two_distributions_is_rejected(monkeypatch):
    entries = [EntryPoint("twice", value, "omnidrive.controllers") for value in ("a:f", "b:f")]
    monkeypatch.setattr(registry, "entries_of", lambda group: {"twice": entries})
    with pytest.raises(InvalidInput, match="declared by several distributions"):
        find_component("controllers", "twice")


def test_file_in_the_folder_of_laws_is_a_controller_that_is_not_imported_to_be_listed(
    tmp_path, monkeypatch
):
    folder = tmp_path / "control" / "laws"
    folder.mkdir(parents=True)
    (folder / "new_law.py").write_text("raise RuntimeError")
    monkeypatch.setattr(entry_points, "_PACKAGE", tmp_path)
    find = entry_points.entries_of.__wrapped__
    (entry,) = find("controllers")["new-law"]
    assert entry.value == "omnidrive.control.laws.new_law:controller"
    assert "sliding-mode" not in find("controllers")
    assert "new-law" not in find("plants")


def test_entry_point_that_fails_to_import_is_named(monkeypatch):
    entry = EntryPoint("broken", "no_such_module_y:f", "omnidrive.controllers")
    monkeypatch.setattr(registry, "entries_of", lambda group: {"broken": [entry]})
    with pytest.raises(InvalidInput, match=r"'broken'.*cannot be imported(?s:.*)no_such_module_y"):
        find_component("controllers", "broken")


class OfAField(BaseModel):
    part: Annotated[Configured, OfGroup("controllers")]


def test_component_that_needs_an_extra_names_it(tmp_path):
    fact = "raise MissingExtra(\"mpc is not installed: pip install 'omnidrive[mpc]'\")"
    text = "from omnidrive.errors import MissingExtra\n{}def law():\n    {}\n"
    (tmp_path / "soon.py").write_text(text.format(f"{fact}\n", "pass"))
    (tmp_path / "late.py").write_text(text.format("", fact))
    soon = f"{tmp_path}/soon.py:law"
    with pytest.raises(MissingExtra, match=r"^mpc is not installed: pip install 'omnidrive\[mpc\]"):
        find_component("controllers", soon, allow_code=True)
    with pytest.raises(ValidationError, match=r"mpc is not installed: pip install"):
        OfAField(part=soon)
    with pytest.raises(MissingExtra, match=r"^mpc is not installed: pip install 'omnidrive\[mpc\]"):
        find_component("controllers", f"{tmp_path}/late.py:law", allow_code=True).make()


@dataclass(frozen=True)
class Inner:
    rate: Annotated[float, od.Bounds(0.0, 5.0, "1/s")] = 1.0
    """Rate, 1/s."""


@dataclass(frozen=True)
class Outer:
    steps: int
    """Number of steps."""
    inner: Inner = Inner(2.0)
    name: str | None = None


def factory(context, parameters: Outer):
    """Return the parameters."""
    return parameters


def test_parameters_are_checked():
    component = Component("controllers", "mine", "", factory)
    assert component.parse({"steps": 3, "inner": {"rate": 4.0}}) == Outer(3, Inner(4.0))
    for values, message in [
        ({"steps": 3, "inner": {"rate": 9.0}}, "is 9 1/s, need 0 to 5 1/s"),
        ({"steps": 3, "inner": {"rat": 1.0}}, "no parameter 'rat'; did you mean 'rate'"),
        ({"steps": 3, "stepz": 1}, "no parameter 'stepz'; did you mean 'steps'"),
        ({}, "Field required"),
        ({"steps": float("nan")}, "finite number"),
    ]:
        with pytest.raises(ValidationError, match=message):
            component.parse(values)


@dataclass(frozen=True)
class OutOfRange:
    gain: Annotated[float, od.Bounds(0.0, 10.0, "1/s")] = 30.0


def out_of_range(context, parameters: OutOfRange):
    """Return the parameters."""
    return parameters


def test_default_out_of_range_is_rejected():
    component = Component("controllers", "mine", "", out_of_range)
    assert component.parse({"gain": 3.0}) == OutOfRange(3.0)
    with pytest.raises(ValidationError, match="is 30 1/s, need 0 to 10 1/s"):
        component.parse({})


def test_parameters_are_described():
    steps, rate, name = parameters_of(Outer)
    assert (steps.name, steps.kind, steps.default, steps.doc) == (
        "steps", "integer", ..., "Number of steps.",
    )  # fmt: skip
    assert (rate.name, rate.unit, rate.range, rate.default) == (
        "inner.rate",
        "1/s",
        (0.0, 5.0),
        2.0,
    )
    assert (name.kind, name.default) == ("text", None)


def test_factories_with_other_signatures_are_rejected():
    with pytest.raises(InvalidInput, match="its arguments are a, b, c, need f"):
        Component("controllers", "mine", "", lambda a, b, c: None).make()
    with pytest.raises(InvalidInput, match="its argument dt is a plain value, need f"):
        Component("controllers", "mine", "", FeedforwardController).make(None)
    with pytest.raises(InvalidInput, match="needs an annotation: the class of the parameters"):
        Component("controllers", "mine", "", lambda context, parameters: None).make()


@pytest.mark.parametrize(
    ("method", "fact"),
    [
        ("step(self, state, reference)", "step(self, state, reference) cannot be called as "
         "step(t, state, reference): define it as def step(self, t, state, reference)"),
        ("step(t, state, reference)", "define it as def step(self, t, state, reference)"),
        ("step(self, t, state, reference, gain)", "cannot be called as step(t, state, reference)"),
    ],
)  # fmt: skip
def test_class_with_a_wrong_signature_is_rejected_when_it_is_loaded(tmp_path, method, fact):
    path = tmp_path / "law.py"
    path.write_text(LAW.replace("step(self, t, state, reference)", method))
    with pytest.raises(InvalidInput, match=re.escape(fact)):
        find_component("controllers", f"{path}:Law", allow_code=True)


@pytest.mark.parametrize("method", ["step(self, *args)", "step(self, t, state, reference, k=1)"])
def test_class_with_a_wider_signature_is_accepted(tmp_path, method):
    path = tmp_path / "law.py"
    path.write_text(LAW.replace("step(self, t, state, reference)", method))
    assert find_component("controllers", f"{path}:Law", allow_code=True).factory


@pytest.mark.parametrize(
    ("group", "missing"),
    [
        ("controllers", "reset"),
        ("plants", "reset and no method close"),
        ("estimators", "reset and no method update"),
    ],
)
def test_class_without_the_methods_of_its_group_is_rejected_when_it_is_loaded(
    tmp_path, group, missing
):
    path = tmp_path / "law.py"
    path.write_text(LAW.replace("    def reset(self, state): pass\n", ""))
    with pytest.raises(InvalidInput, match=rf"is no {group[:-1]}: it has no method {missing}$"):
        find_component(group, f"{path}:Law", allow_code=True)


def test_methods_of_a_wrapper_are_those_of_its_target():
    class Wrapper:
        def __init__(self):
            self.law = od.FeedforwardController(0.1)

        def __getattr__(self, name):
            return getattr(self.law, name)

    assert Component("controllers", "mine", "", Wrapper).make().dt == 0.1


def test_configured_component_is_restored_from_a_pickle(law):
    configured = configure("controllers", law, {"gain": 7.0})
    again = pickle.loads(pickle.dumps(configured))
    assert again == configured
    assert again.make(None).parameters.gain == 7.0
    assert again.with_values(gain=8.0) != configured


@pytest.mark.parametrize(
    ("text", "specification"),
    [
        ("pid", ("pid", "pid", {})),
        ("mine.py:Law", ("Law", "mine.py:Law", {})),
        ("a=mine.py:Law,gain=2", ("a", "mine.py:Law", {"gain": 2})),
        ("n, w.p=3.5 ,w.q=no,s=x y", ("n", "n", {"w": {"p": 3.5, "q": False}, "s": "x y"})),
        ("n,a=null,b=[1]", ("n", "n", {"a": None, "b": "[1]"})),
    ],
)
def test_specification_is_parsed(text, specification):
    assert parse_specification(text) == specification


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not of the form"),
        ("=pid", "is not of the form"),
        ("a=", "is not of the form"),
        ("pid,gain", "is not KEY=VALUE"),
        ("pid,=2", "is not KEY=VALUE"),
        ("pid,a=1,a=2", "'a' occurs twice"),
        ("pid,a=1,a.b=2", "'a' has a value already"),
        ("p" * 3000, "at most 2000 characters"),
    ],
)
def test_bad_specification_is_rejected(text, message):
    with pytest.raises(InvalidInput, match=message):
        parse_specification(text)
