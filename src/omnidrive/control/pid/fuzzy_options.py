"""Membership functions, rules and footprints of the gain-tuning system, as parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any

from jaxtyping import Int
from pydantic import BeforeValidator, Field

from omnidrive.arrays import Array
from omnidrive.components.fields import PresetDefaults, plain
from omnidrive.control.pid.gain_tuning import (
    INPUTS,
    MEDIUM,
    OUTPUTS,
    SMALL,
    Breakpoints,
    gain_tuning_system,
)
from omnidrive.control.pid.rules import LABELS
from omnidrive.control.pid.system_file import SystemFile
from omnidrive.errors import InvalidInput, short_repr
from omnidrive.fuzzy import Footprint, FuzzySystem
from omnidrive.parameter import Bounds

_ZERO = LABELS.index("ZO")


def _full_table(value: Any) -> Any:
    """Return a table of 7 x 7 numbers or None; single rules are a mapping of mappings.

    Raises:
        ValueError: The value has another form, or contains the name of no set.
    """
    if isinstance(value, Mapping):
        rows: list[list[Any]] = [[None] * len(LABELS) for _ in LABELS]
        for error, row in value.items():
            if not isinstance(row, Mapping):
                raise ValueError(_FORM.format(short_repr(row)))  # noqa: TRY004
            for change, consequent in row.items():
                rows[_set_index(error)][_set_index(change)] = consequent
    elif value is None or _has_entries(value):
        rows = value
    else:
        raise ValueError(_FORM.format(short_repr(value)))
    if value is None:
        return None
    if not all(map(_has_entries, rows)):
        raise ValueError(_FORM.format(short_repr(value)))
    return tuple(tuple(map(_number, row)) for row in rows)


def _number(cell: Any) -> Any:
    """Return the number of a consequent from -3 to 3, or None.

    Raises:
        ValueError: It is no consequent.
    """
    if isinstance(cell, str):
        return _set_index(cell) - _ZERO
    if cell is not None and (type(cell) is not int or abs(cell) > _ZERO):
        raise ValueError(
            f"has the unknown consequent {short_repr(cell)}; need one of {', '.join(LABELS)}, or "
            f"{-_ZERO} to {_ZERO}"
        )
    return cell


def _has_entries(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(value) == len(LABELS)


def _set_index(name: Any) -> int:
    if name not in LABELS:
        raise ValueError(f"has the unknown set {short_repr(name)}; sets are {', '.join(LABELS)}")
    return LABELS.index(name)


_FORM = (
    "must be rules such as ZO.ZO=PB (error ZO, its change ZO, consequent PB), or 7 rows of 7 "
    "consequents; got {}"
)

_Cell = Annotated[int, Bounds(-3, 3, "")] | None
_Row = Annotated[tuple[_Cell, ...], Field(min_length=7, max_length=7)]
RuleTable = Annotated[
    tuple[_Row, ...], BeforeValidator(_full_table), Field(min_length=7, max_length=7)
]
"""Consequents of one gain: rows are the sets of the error, columns those of its change, NB to PB;
-3: NB, -2: NM, -1: NS, 0: ZO, 1: PS, 2: PM, 3: PB, or these names; None: that of the preset. Single
rules are a mapping from sets of the error to mappings from sets of its change to consequents."""


@dataclass(frozen=True)
class SetOptions(PresetDefaults):
    """Peaks of the sets of one variable, as shares of its range, symmetric about zero.

    The sets are triangles between the points 0, small, medium and 1. None: those of the paper,
    equally spaced.
    """

    small: Annotated[float, Bounds(0.02, 0.5, "1")] | None = None
    """Peak of the sets NS and PS."""
    medium: Annotated[float, Bounds(0.5, 0.98, "1")] | None = None
    """Peak of the sets NM and PM."""

    @property
    def breakpoints(self) -> Breakpoints:
        """Peaks of the small and medium sets."""
        return Breakpoints(
            SMALL if self.small is None else self.small,
            MEDIUM if self.medium is None else self.medium,
        )


@dataclass(frozen=True)
class RuleOptions(PresetDefaults):
    """Consequents of the rules of each gain: 7 rows, the sets of the error, of 7 columns.

    The columns are the sets of the change of the error; -3: NB to 3: PB, or the names. Single rules
    are `{ZO: {ZO: PB}}`: error ZO, its change ZO, consequent PB; on the command line
    `fuzzy.rules.kp.ZO.ZO=PB`. None: the table or the rule of the preset.
    """

    kp: RuleTable | None = None
    """Change of kp."""
    ki: RuleTable | None = None
    """Change of ki."""
    kd: RuleTable | None = None
    """Change of kd."""

    def applied(self, rules: Int[Array, "7 7 3"]) -> Int[Array, "7 7 3"]:
        """Return a rule table of :mod:`omnidrive.control.pid.rules` with the given consequents."""
        rules = rules.copy()
        for gain, name in enumerate(OUTPUTS):
            table = getattr(self, name)
            for i, row in enumerate(table or ()):
                for j, cell in enumerate(row):
                    if cell is not None:
                        rules[i, j, gain] = cell + _ZERO
        return rules

    def resolved(self, rules: Int[Array, "7 7 3"]) -> RuleOptions:
        """Return the consequents of all gains."""
        used = self.applied(rules) - _ZERO
        tables = {name: _table(used[:, :, gain]) for gain, name in enumerate(OUTPUTS)}
        return replace(self, **tables)


@dataclass(frozen=True)
class FootprintOptions(PresetDefaults):
    """Footprint of uncertainty of sets. None: the value of the preset."""

    scale: Annotated[float, Bounds(0.05, 1.0, "1")] | None = None
    """Peak of the lower membership function over that of the upper one."""
    lag: Annotated[float, Bounds(0.0, 0.95, "1")] | None = None
    """Degree of the upper membership function up to which the lower one is zero."""

    def applied(self, footprint: Footprint) -> Footprint:
        """Return a footprint with the given values."""
        return Footprint(
            footprint.scale if self.scale is None else self.scale,
            footprint.left if self.lag is None else self.lag,
        )

    def resolved(self, footprint: Footprint) -> FootprintOptions:
        """Return the options with both values."""
        used = self.applied(footprint)
        return replace(self, scale=used.scale, lag=used.left)


@dataclass(frozen=True)
class FuzzyOptions(PresetDefaults):
    """Membership functions and rules of the fuzzy system that tunes the gains."""

    error: SetOptions = field(default_factory=SetOptions)
    """Sets of the scaled error."""
    derror: SetOptions = field(default_factory=SetOptions)
    """Sets of its scaled change."""
    kp: SetOptions = field(default_factory=SetOptions)
    """Sets of the change of kp."""
    ki: SetOptions = field(default_factory=SetOptions)
    """Sets of the change of ki."""
    kd: SetOptions = field(default_factory=SetOptions)
    """Sets of the change of kd."""
    rules: RuleOptions = field(default_factory=RuleOptions)
    """Consequents of the rules."""
    file: str | SystemFile | None = None
    """File of a system that replaces the paper's: .fis, .fll, .fcl or .fml, with 2 inputs within
    [-1, 1], the scaled error and its change, and 3 outputs within [-0.1, 0.1], the changes of kp,
    ki and kd. In a scenario, study or controller file, its path is relative to that file; those
    that omnidrive writes hold its `name` and `content`."""

    def __post_init__(self) -> None:
        if self.file is None:
            return
        given = [each for each in (*INPUTS, *OUTPUTS, "rules") if plain(getattr(self, each))]
        if given:
            raise InvalidInput(f"the system in the file has sets and rules; leave out {given[0]}")
        if isinstance(self.file, str):
            object.__setattr__(self, "file", SystemFile.read(self.file))
        self._check_type(self._file_system())

    def _file_system(self) -> FuzzySystem:
        assert isinstance(self.file, SystemFile)
        return self.file.system

    def _check_type(self, system: FuzzySystem) -> None:
        """Raise InvalidInput unless the options apply to the type of a system in a file."""
        if system.type > 1:
            raise InvalidInput(f"the system in the file is of type {system.type}; use fuzzy_t2")

    def system(self, rules: Int[Array, "7 7 3"]) -> FuzzySystem:
        """Return the system, of type 1 or that of a file; ``rules``: table of the preset."""
        if self.file is not None:
            return self._file_system()
        names = (*INPUTS, *OUTPUTS)
        return gain_tuning_system(
            self.rules.applied(rules), {name: getattr(self, name).breakpoints for name in names}
        )

    def footprints(self, inputs: Footprint, outputs: Footprint) -> tuple[Footprint, Footprint]:
        """Return the footprints of inputs and outputs, from those of the preset."""
        return inputs, outputs

    def resolved(
        self, rules: Int[Array, "7 7 3"], inputs: Footprint, outputs: Footprint
    ) -> FuzzyOptions:
        """Return the options with all values, from those of the preset; a file has its own."""
        if self.file is not None:
            return self
        sets: dict[str, Any] = {
            name: _resolved_sets(getattr(self, name)) for name in (*INPUTS, *OUTPUTS)
        }
        return replace(self, rules=self.rules.resolved(rules), **sets)


@dataclass(frozen=True)
class IntervalFuzzyOptions(FuzzyOptions):
    """Membership functions with footprints of uncertainty, and rules, of the fuzzy system."""

    inputs: FootprintOptions = field(default_factory=FootprintOptions)
    """Footprint of the sets of the inputs."""
    outputs: FootprintOptions = field(default_factory=FootprintOptions)
    """Footprint of the sets of the outputs."""

    def _check_type(self, system: FuzzySystem) -> None:
        given = [each for each in ("inputs", "outputs") if plain(getattr(self, each))]
        if system.type > 1 and given:
            raise InvalidInput(f"the sets in the file have footprints; leave out {given[0]}")

    def footprints(self, inputs: Footprint, outputs: Footprint) -> tuple[Footprint, Footprint]:
        """Return the footprints of inputs and outputs, from those of the preset."""
        return self.inputs.applied(inputs), self.outputs.applied(outputs)

    def resolved(
        self, rules: Int[Array, "7 7 3"], inputs: Footprint, outputs: Footprint
    ) -> IntervalFuzzyOptions:
        """Return the options with all values, from those of the preset."""
        if self.file is not None:
            return self
        inner = super().resolved(rules, inputs, outputs)
        own = {each.name: getattr(inner, each.name) for each in fields(FuzzyOptions)}
        return IntervalFuzzyOptions(
            **own,
            inputs=self.inputs.resolved(inputs),
            outputs=self.outputs.resolved(outputs),
        )


def _resolved_sets(options: SetOptions) -> SetOptions:
    return replace(options, **options.breakpoints._asdict())


def _table(values: Int[Array, "7 7"]) -> RuleTable:
    return tuple(map(tuple, values.tolist()))
