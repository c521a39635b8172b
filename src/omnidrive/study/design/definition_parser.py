"""Parser of what varies in a study: axes, random factors and conditions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, get_args

from pydantic import ValidationError

from omnidrive.choices import TaskName
from omnidrive.components.code import CodePermission
from omnidrive.components.fields import plain
from omnidrive.errors import InvalidInput, InvalidStudy, one_line, short_repr, suggestion
from omnidrive.scenario.run_settings import RunSettings, settings_of_runs
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_file import problems_of, scenario_data
from omnidrive.scenario.scenario_path import Keys, Setting, find_keys, relocated, value_at
from omnidrive.scenario.variant import changed_sections, robot_in, variant_data, variant_of
from omnidrive.study.design.axes import Axis, Label, moved_files, parse_axis
from omnidrive.study.design.definition import Condition
from omnidrive.study.design.random_factors import MAX_DIMENSIONS, RandomFactor, parse_factor

_RUN_KEYS = ("controller", "task", "duration", "horizon", "fault")


class DefinitionParser:
    """Parser of axes, random factors and conditions, which collects all problems.

    Args:
        scenario: The base scenario.
        move: Returns the name of a file relative to the working folder.
        allow_code: Whether components may be code that is not installed.

    Attributes:
        problems: Messages about all invalid keys and values.
    """

    def __init__(
        self, scenario: Scenario, move: Callable[[str], str], allow_code: bool | CodePermission
    ) -> None:
        self.problems: list[str] = []
        self._scenario, self._data = scenario, scenario_data(scenario)
        self._move, self._allow_code = move, allow_code

    def axes(self, sources: Mapping[str, Any]) -> tuple[Axis, ...]:
        """Return the axes, with checked and completed values."""
        found = []
        for path, source in sources.items():
            try:
                axis = parse_axis(path, source, self._find)
                moved = moved_files(axis, self._move)
                labels = axis.labels
                axis = replace(parse_axis(path, moved, self._find), labels=labels)
            except InvalidStudy as error:
                self._note(path, error)
                continue
            labels, settings = self._resolved(path, axis.labels, axis.settings)
            found.append(replace(axis, settings=settings, labels=labels))
        return tuple(found)

    def factors(self, sources: Mapping[str, Any]) -> tuple[RandomFactor, ...]:
        """Return the random factors, with checked and completed choices and checked ranges."""
        found = []
        for path, source in sources.items():
            try:
                factor = parse_factor(path, self._find(path), source)
            except InvalidStudy as error:
                self._note(path, error)
                continue
            if factor.choices:
                found.append(self._with_choices(factor))
                continue
            for end in factor.ends:
                setting = Setting(factor.keys, end, factor.relative, drawn=True)
                self._checked(path, "", (setting,), is_random=True)
            found.append(factor)
        if sum(each.dimensions for each in found) > MAX_DIMENSIONS:
            self.problems.append(f"random has more than {MAX_DIMENSIONS} numbers")
        return tuple(found)

    def _with_choices(self, factor: RandomFactor) -> RandomFactor:
        """Return a factor with checked and completed choices."""
        keys = factor.keys
        moved = [relocated(each, keys, self._move) for each in factor.choices]
        given = [(Setting(keys, each),) for each in moved]
        labels, settings = self._resolved(factor.path, factor.labels, given, is_random=True)
        choices = tuple(each.value for (each,) in settings)
        return replace(factor, source={"choices": moved}, choices=choices, labels=labels)

    def _resolved(
        self,
        path: str,
        labels: Sequence[Label],
        settings: Sequence[tuple[Setting, ...]],
        *,
        is_random: bool = False,
    ) -> tuple[tuple[Label, ...], tuple[tuple[Setting, ...], ...]]:
        """Return the values of an axis or random factor as the scenario holds them."""
        found = tuple(
            self._checked(path, str(label), each, is_random=is_random)
            for label, each in zip(labels, settings, strict=True)
        )
        return tuple(map(_label, labels, found)), found

    def check_overlap(self, axes: Sequence[Axis], factors: Sequence[RandomFactor]) -> None:
        """Note paths that occur twice, or one within another."""
        owned: list[tuple[str, Keys]] = [(each.path, keys) for each in axes for keys in each.keys]
        owned += [(each.path, each.keys) for each in factors]
        for i, (path, keys) in enumerate(owned):
            for other, before in owned[:i]:
                shorter = min(len(keys), len(before))
                if keys[:shorter] == before[:shorter]:
                    names = f"'{path}'" if path == other else f"'{other}' and '{path}'"
                    self.problems.append(f"{names}: one setting varies twice")

    def condition(self, name: str, source: dict[str, Any], axes: Sequence[Axis]) -> Condition:
        """Return a condition, whose keys are axes or fields of a run."""
        values: dict[int, frozenset[int]] = {}
        run: dict[str, tuple[Any, ...]] = {}
        known = [each.path for each in axes]
        for key, wanted in source.items():
            if key in known:
                values[known.index(key)] = self._indices(name, axes[known.index(key)], wanted)
            elif key in _RUN_KEYS:
                run[key] = tuple(wanted) if isinstance(wanted, list) else (wanted,)
                self._check_run(name, key, run[key], axes)
            else:
                hint = suggestion(str(key), [*known, *_RUN_KEYS], maximum=30)
                self.problems.append(f"{name}: unknown axis '{one_line(str(key), 60)}'{hint}")
        return Condition(source, values, run)

    def _indices(self, name: str, axis: Axis, wanted: Any) -> frozenset[int]:
        """Return the indices of the values of an axis that a condition names."""
        found = set()
        for each in wanted if isinstance(wanted, list) else [wanted]:
            fitting = {i for i, label in enumerate(axis.labels) if _same(label, each)}
            if not fitting:
                shown = ", ".join(str(label) for label in axis.labels[:12])
                self.problems.append(
                    f"{name}: {axis.path} has no value {short_repr(each)}; there are {shown}"
                )
            found |= fitting
        return frozenset(found)

    def _check_run(
        self, name: str, key: str, values: tuple[Any, ...], axes: Sequence[Axis]
    ) -> None:
        known: tuple[str, ...] = get_args(TaskName)
        if key == "controller":
            known = tuple(self._scenario.controllers)
        has_others = any(keys == ("controllers",) for axis in axes for keys in axis.keys)
        if key not in {"task", "controller"} or (key == "controller" and has_others):
            return
        for each in values:
            if each not in known:
                hint = suggestion(str(each), known)
                self.problems.append(f"{name}: there is no {key} {short_repr(each)}{hint}")

    def _find(self, path: str) -> Keys:
        return find_keys(self._data, path)

    def _checked(
        self, path: str, label: str, settings: tuple[Setting, ...], *, is_random: bool = False
    ) -> tuple[Setting, ...]:
        """Return settings with the values as the scenario holds them; note what it refuses."""
        try:
            data = variant_data(self._data, settings)
            variant = variant_of(
                self._scenario, data, changed_sections(settings), allow_code=self._allow_code
            )
            sections = {name: plain(getattr(variant, name)) for name in changed_sections(settings)}
            for robot in {"robot", "plant_robot"} & sections.keys():
                if sections[robot] is not None:
                    robot_in(sections[robot])
            if is_random and _runs(variant) != _runs(self._scenario):
                raise InvalidStudy(
                    f"{label or 'the range'} changes which runs the study has, and a random factor "
                    "must not: make it an axis"
                )
        except ValidationError as error:
            self.problems += [
                fact if path.partition(".")[0] in fact else f"{path} {label}: {fact}"
                for fact in problems_of(error)
            ]
            return settings
        except InvalidInput as error:
            self._note(path, error)
            return settings
        return tuple(
            each if each.relative else each._replace(value=value_at(sections, each.keys))
            for each in settings
        )

    def _note(self, path: str, error: Exception) -> None:
        text = str(error)
        self.problems.append(text if f"'{path}'" in text else f"{one_line(path, 80)}: {text}")


def _runs(scenario: Scenario) -> list[RunSettings]:
    """Return the runs of a scenario, whatever the horizons of its controllers."""
    found = settings_of_runs(scenario)
    return [each if each.task == "horizon" else each._replace(horizon=None) for each in found]


def _label(label: Label, settings: tuple[Setting, ...]) -> Label:
    """Return the label of a checked value: a number as the scenario holds it."""
    value = settings[0].value if len(settings) == 1 else None
    return value if isinstance(value, int | float) and value == label else label


def _same(label: Any, wanted: Any) -> bool:
    with suppress(TypeError):
        if isinstance(label, bool) == isinstance(wanted, bool) and label == wanted:
            return True
    return isinstance(label, str) and label == str(wanted)
