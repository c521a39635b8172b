"""Documentation of fields, read from source code."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import pytest
from pydantic import BaseModel

from omnidrive.components.documentation import field_docs, field_names, plain_text
from omnidrive.control import HolonomicParameters
from omnidrive.estimation import PoseFixSettings
from omnidrive.parameter import Bounds
from omnidrive.planning import PathOptions
from omnidrive.scenario import Scenario


class Gains(NamedTuple):
    """Gains of a test."""

    position: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of the position,
    in 1/s; see :func:`omnidrive.robot.named_robot` and ``exp``."""
    heading: float = 5.0


class Model(BaseModel):
    """A model with a constant.

    Attributes:
        known: Names, which are
            no field.
        gain: From the section
            of the class.
        factor: Overridden below.

    Raises:
        nothing: Never.
    """

    known: ClassVar[int] = 3
    gain: float = 1.0
    factor: float = 2.0
    """From the literal."""


class Derived(Model):
    """A model with more fields and one without documentation."""

    more: float = 1.0
    """Of the derived class."""
    gain: float = 3.0
    without: float = 0.0


def test_namedtuple_as_one_line_of_markdown():
    text = "Decay rate of the position, in 1/s; see `named_robot` and `exp`."
    assert field_docs(Gains) == {"position": text}
    assert field_names(Gains) == ["position", "heading"]


def test_model_with_section_of_attributes_and_literals():
    assert field_docs(Model) == {
        "gain": "From the section of the class.",
        "factor": "From the literal.",
    }


def test_inherited_fields_in_the_order_of_the_fields():
    assert field_docs(Derived) == field_docs(Model) | {"more": "Of the derived class."}
    assert list(field_docs(Derived)) == ["gain", "factor", "more"]


def test_class_in_a_function():
    @dataclass
    class Local:
        size: float = 1.0
        """Size of it."""

    assert field_docs(Local) == {"size": "Size of it."}


def test_class_without_source():
    namespace = {"__name__": "nowhere"}
    exec("class Typed:\n    x: int = 1\n    'A number.'", namespace)
    assert field_docs(namespace["Typed"]) == {}
    assert field_docs(int) == {}


@pytest.mark.parametrize("cls", [HolonomicParameters, PoseFixSettings, PathOptions])
def test_parameters_of_the_package_are_documented(cls):
    assert list(field_docs(cls)) == field_names(cls)


def test_fields_of_a_scenario():
    docs = field_docs(Scenario)
    assert docs["sample_time"] == "Sample time of controllers and log, s."
    assert "old_keys" not in docs


def test_first_paragraph():
    assert plain_text("First\n    line.\n\n    More.") == "First line."
