"""Gain-tuning systems in files, such as those of MATLAB, instead of the paper's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from omnidrive.control.pid.gain_tuning import INPUTS, OUTPUTS
from omnidrive.control.pid.laws import MAX_GAIN_CHANGE
from omnidrive.errors import InvalidFuzzyFile, one_line
from omnidrive.fuzzy import FuzzySystem, LinearFunction, OutputVariable
from omnidrive.fuzzy.files.format import read_text, system_of

_MAX_LENGTH = 1_000_000  # characters: scenarios and run folders hold the text
_ROUNDING = 1e-9


@dataclass(frozen=True)
class SystemFile:
    """A fuzzy system in a file: its name and its content, so that runs do not need the file.

    Raises:
        InvalidFuzzyFile: The content is no fuzzy system, or not one from an error and its change,
            each within [-1, 1], to the changes of kp, ki and kd, each within [-0.1, 0.1] also
            where no rule fires.
    """

    name: str
    """Name of the file; its suffix is that of the format."""
    content: str
    """Text of the file."""

    def __post_init__(self) -> None:
        if len(self.content) > _MAX_LENGTH:
            raise InvalidFuzzyFile(
                f"the file {one_line(self.name)} has more than {_MAX_LENGTH} characters"
            )
        _ = self.system

    @classmethod
    def read(cls, name: str) -> SystemFile:
        """Return the system in a file; its name without its folders.

        Raises:
            InvalidFuzzyFile: The file cannot be read, or as for the class.
        """
        return cls(Path(name).name, read_text(Path(name)))

    @property
    def system(self) -> FuzzySystem:
        """The fuzzy system."""
        return _system(self.name, self.content)


@lru_cache(maxsize=16)
def _system(name: str, content: str) -> FuzzySystem:
    try:
        system = system_of(content, Path(name))
    except InvalidFuzzyFile as error:
        raise InvalidFuzzyFile(f"the file {error}") from None
    if (fact := _unsuitable(system)) is not None:
        raise InvalidFuzzyFile(f"the file {one_line(name)}: {fact}")
    return system


def _unsuitable(system: FuzzySystem) -> str | None:
    """Return why a system cannot tune gains; None: it can."""
    inputs, outputs = system.inputs, system.outputs
    if (len(inputs), len(outputs)) != (len(INPUTS), len(OUTPUTS)):
        return (
            f"a system that tunes gains has 2 inputs, the error and its change, and 3 outputs, the "
            f"changes of kp, ki and kd; this one has {_counted('input', [v.name for v in inputs])} "
            f"and {_counted('output', [v.name for v in outputs])}"
        )
    names = [each.name.lower() for each in outputs]
    if tuple(names) != OUTPUTS and set(names) == set(OUTPUTS):
        return f"its outputs are {', '.join(names)}, need the order {', '.join(OUTPUTS)}"
    for each in inputs:
        if abs(each.low + 1.0) > _ROUNDING or abs(each.high - 1.0) > _ROUNDING:
            return (
                f"the input {each.name!r} has the range [{each.low:g}, {each.high:g}], need "
                "[-1, 1], to which the controller scales the error and its change"
            )
    facts = map(_excess, outputs)
    return next((each for each in facts if each is not None), None)


def _excess(output: OutputVariable) -> str | None:
    """Return why the values of an output may exceed the greatest change of a gain; None: not."""
    if output.defuzzifier == "wtsum":
        return (
            f"the output {output.name!r} is a weighted sum (wtsum), which has no bound if several "
            "rules fire; use the weighted average (wtaver)"
        )
    low, high = _reach(output)
    need = (
        f"need values within [-{MAX_GAIN_CHANGE:g}, {MAX_GAIN_CHANGE:g}], which the controller "
        "scales to the change of the gain"
    )
    if max(-low, high) > MAX_GAIN_CHANGE + _ROUNDING:
        return f"the output {output.name!r} has values from {low:g} to {high:g}, {need}"
    if abs(output.fallback) > MAX_GAIN_CHANGE + _ROUNDING:
        origin = (
            f"the middle of its range [{output.low:g}, {output.high:g}]"
            if output.default is None
            else "its default"
        )
        return (
            f"the output {output.name!r} is {output.fallback:g}, {origin}, where no rule fires; "
            f"{need}"
        )
    return None


def _reach(output: OutputVariable) -> tuple[float, float]:
    """Return the least and the greatest value of the rules' outputs for inputs within [-1, 1].

    That of sets lies in the range of the output. A weighted average of functions lies between
    their least and their greatest value.
    """
    functions = [each for each in output.sets if isinstance(each, LinearFunction)]
    if not functions:
        return output.low, output.high
    spans = [(each.constant, sum(map(abs, each.coefficients))) for each in functions]
    return min(at - span for at, span in spans), max(at + span for at, span in spans)


def _counted(what: str, names: Sequence[str]) -> str:
    """Return number and names of variables, such as ``1 input (speed)``."""
    shown = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
    return f"{len(names)} {what}{'' if len(names) == 1 else 's'} ({shown})"
