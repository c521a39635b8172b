"""Study files in YAML, and the studies of this package."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import yaml
from pydantic import Field, ValidationError

from omnidrive.choices import PresetName
from omnidrive.components.code import CodePermission
from omnidrive.components.configured import ALLOW_CODE
from omnidrive.errors import InvalidInput, InvalidStudy, one_line, short_repr, suggestion
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, is_path, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.parameter import Bounds
from omnidrive.scenario.scenario import Scenario, paper_scenario
from omnidrive.scenario.scenario_file import (
    listed,
    load_scenario,
    problems_of,
    scenario_data,
)
from omnidrive.scenario.scenario_path import (
    Setting,
    allow_named,
    beside,
    find_keys,
    relocated,
)
from omnidrive.scenario.section import Section
from omnidrive.scenario.variant import changed_sections, variant_data, variant_of
from omnidrive.study.design.axes import first_values, moved_files
from omnidrive.study.design.definition import (
    FORMAT,
    MAX_REPETITIONS,
    SeriesKept,
    StudyDefinition,
)
from omnidrive.study.design.definition_parser import DefinitionParser
from omnidrive.study.design.random_factors import (
    Method,
    RandomFactors,
)

_ROOT = files("omnidrive.study") / "studies"
_MAX_AXES = 50


class _Random(Section):
    method: Method = "sobol"
    factors: dict[str, Any] = Field(default_factory=dict)


class _StudyFile(Section):
    format: Literal["omnidrive-study-1"]
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]{0,63}$")]
    question: Annotated[str, Field(max_length=500)] = ""
    scenario: Any
    set: dict[str, Any] = Field(default_factory=dict)
    axes: Annotated[dict[str, Any], Field(default_factory=dict, max_length=_MAX_AXES)]
    random: _Random = _Random()
    repetitions: Annotated[int, Bounds(1, MAX_REPETITIONS, "")] = 1
    where: tuple[dict[str, Any], ...] = ()
    leave_out: tuple[dict[str, Any], ...] = ()
    series: SeriesKept = "none"


def study_names() -> tuple[str, ...]:
    """Return the names of the studies of this package."""
    return tuple(sorted(each.name.removesuffix(".yaml") for each in _ROOT.iterdir()))


def load_definition(
    source: StrPath,
    *,
    changes: Mapping[str, Any] | None = None,
    allow_code: bool | CodePermission = False,
) -> StudyDefinition:
    """Read a study file, or a study of this package by its name.

    Args:
        source: The file, or a name of :func:`study_names`; a name has no suffix and no separator.
        changes: Values of settings of the base scenario by their dotted paths; those that are axes
            or random factors of the study become fixed. Code that they name may be imported.
        allow_code: Whether components may be code that is not installed; only for files that you
            trust.

    Raises:
        InvalidStudy: The file is missing, malformed or of another version; a setting is unknown; or
            a value is invalid. The message names up to ten problems.
    """
    path = to_path(source)
    if not is_path(os.fspath(source)):
        if str(source) not in study_names():
            hint = suggestion(str(source), study_names())
            raise InvalidStudy(
                f"there is no study '{one_line(str(source), 60)}'{hint} (your own: a file, which "
                "ends with .yaml)"
            )
        path = Path(str(_ROOT / f"{source}.yaml"))
    data, name = read_yaml(path, "study", InvalidStudy), one_line(str(path))
    return parse_definition(data, name, path, changes=changes, allow_code=allow_code)


def parse_definition(
    data: Any,
    where: str,
    file: StrPath | None = None,
    *,
    changes: Mapping[str, Any] | None = None,
    allow_code: bool | CodePermission = False,
) -> StudyDefinition:
    """Validate ``data`` and return the study.

    Args:
        data: Content of a study file.
        where: Source of the data, for messages.
        file: The study file, to which names of files are relative. None: the working folder.
        changes: See :func:`load_definition`.
        allow_code: See :func:`load_definition`.

    Raises:
        InvalidStudy: A key, a setting or a value is invalid; the message names the first ten.
    """
    move = beside(to_path("study.yaml" if file is None else file))
    given = _parse_file(data, where)
    try:
        scenario = _base_scenario(_with_first_values(given), move, allow_code)
        for path, value in (changes or {}).items():
            allow_named(path, value)
        fixed = {**given.set, **(changes or {})}
        scenario = _with_fixed(scenario, fixed, {*given.set}, move, allow_code)
    except InvalidInput as error:
        raise InvalidStudy(f"{where}: {error}") from None
    parser = DefinitionParser(scenario, move, allow_code)
    axes = parser.axes({k: v for k, v in given.axes.items() if k not in (changes or {})})
    factors = {k: v for k, v in given.random.factors.items() if k not in (changes or {})}
    random = RandomFactors(parser.factors(factors), given.random.method)
    parser.check_overlap(axes, random.factors)
    conditions = {
        name: tuple(parser.condition(name, each, axes) for each in getattr(given, name))
        for name in ("where", "leave_out")
    }
    if parser.problems:
        raise InvalidStudy(f"{where}: {listed(list(dict.fromkeys(parser.problems)))}")
    return StudyDefinition(
        given.name, scenario, axes, random, given.repetitions, given.question, **conditions,
        series=given.series,
    )  # fmt: skip


def _parse_file(data: Any, where: str) -> _StudyFile:
    """Return the content of a study file; its keys are known."""
    if not isinstance(data, dict):
        raise InvalidStudy(f"{where} is not a study: it contains no keys")
    found = data.get("format")
    if found != FORMAT:
        if isinstance(found, str) and found.startswith("omnidrive-study-"):
            raise InvalidStudy(
                f"{where} has the format {one_line(found, 60)}, of another version of omnidrive; "
                f"this one reads {FORMAT}"
            )
        if found == Scenario.model_fields["format"].default:
            raise InvalidStudy(f"{where} is a scenario file; use omnidrive compare {where}")
        raise InvalidStudy(f"{where} is not a study file: it needs format: {FORMAT}")
    try:
        return _StudyFile.model_validate(data)
    except ValidationError as error:
        raise InvalidStudy(f"{where}: {listed(problems_of(error, _StudyFile))}") from None


def _with_first_values(given: _StudyFile) -> Any:
    """Return the base scenario; its data need not hold sections that vary or are set.

    A section that they lack has the value that is set, or the first one of its axis.
    """
    if not isinstance(given.scenario, dict):
        return given.scenario
    found = dict(given.scenario)
    cases = [(path, value) for path, value in given.set.items()]
    cases += [each for path, source in given.axes.items() for each in first_values(path, source)]
    for path, value in cases:
        head, _, rest = path.partition(".")
        if head not in found and rest in {"", "type"}:
            found[head] = {rest: value} if rest else value
    return found


def _base_scenario(
    source: Any, move: Callable[[str], str], allow_code: bool | CodePermission
) -> Scenario:
    """Return the scenario of a preset, of a file, or of its data."""
    if isinstance(source, str):
        if source in get_args(PresetName):
            return paper_scenario(source)  # type: ignore[arg-type]
        if not source.endswith((".yaml", ".yml")):
            hint = suggestion(source, get_args(PresetName))
            raise InvalidStudy(f"scenario: no file (.yaml) or preset {short_repr(source)}{hint}")
        return load_scenario(move(source), allow_code=allow_code)
    if not isinstance(source, dict) or not all(isinstance(key, str) for key in source):
        raise InvalidStudy(
            f"scenario must be a preset, a file or the keys of one, got {short_repr(source)}"
        )
    return _validated({"name": "base", **relocated(source, (), move)}, allow_code)


def _validated(data: dict[str, Any], allow_code: bool | CodePermission) -> Scenario:
    try:
        return Scenario.model_validate(data, context={ALLOW_CODE: allow_code})
    except ValidationError as error:
        raise InvalidStudy(f"scenario: {listed(problems_of(error))}") from None


def _with_fixed(
    scenario: Scenario,
    fixed: Mapping[str, Any],
    of_file: set[str],
    move: Callable[[str], str],
    allow_code: bool | CodePermission,
) -> Scenario:
    """Return the scenario with fixed settings; file names of the study file are beside it."""
    data = scenario_data(scenario)
    settings: list[Setting] = []
    problems: list[str] = []
    for path, value in fixed.items():
        try:
            keys = find_keys(data, path, addable=True)
        except InvalidStudy as error:
            problems.append(str(error))
            continue
        value = relocated(value, keys, move) if path in of_file else value  # noqa: PLW2901
        settings.append(Setting(keys, value))
    found = scenario
    try:
        if settings:
            changed, sections = variant_data(data, settings), changed_sections(settings)
            found = variant_of(scenario, changed, sections, allow_code=allow_code)
    except ValidationError as error:
        problems += problems_of(error)
    if problems:
        raise InvalidStudy(listed(problems))
    return found


class _Dumper(yaml.SafeDumper):
    """Dumper without aliases, which study files may not contain."""

    def ignore_aliases(self, data: Any) -> bool:
        """Return True."""
        return True


def save_definition(definition: StudyDefinition, path: StrPath) -> None:
    """Write a study file that :func:`load_definition` can read; file names are relative to it.

    Raises:
        CannotWrite: The file cannot be written.
    """
    path = to_path(path)
    text = yaml.dump(definition_data(definition, path), Dumper=_Dumper, sort_keys=False)
    with output_file(path) as part:
        part.write_text(text, encoding="utf-8")


def definition_data(definition: StudyDefinition, file: StrPath | None = None) -> dict[str, Any]:
    """Return the study as dictionaries, lists, numbers and strings.

    Args:
        definition: The study.
        file: Study file to which names of files are relative. None: the working folder.
    """
    folder = None if file is None else to_path(file).absolute().parent

    def move(name: str) -> str:
        """Return the name of a file relative to the folder."""
        return name if folder is None else os.path.relpath(name, folder)

    random = definition.random
    factors = {
        each.path: {"choices": [relocated(v, each.keys, move) for v in each.source["choices"]]}
        if each.choices
        else each.source
        for each in random.factors
    }
    data: dict[str, Any] = {
        "format": FORMAT,
        "name": definition.name,
        "question": definition.question,
        "scenario": relocated(definition.data, (), move),
        "axes": {each.path: moved_files(each, move) for each in definition.axes},
        "random": {"method": random.method, "factors": factors},
        "repetitions": definition.repetitions,
        "where": [each.source for each in definition.where],
        "leave_out": [each.source for each in definition.leave_out],
        "series": definition.series,
    }
    return {key: value for key, value in data.items() if value not in ("", [], {})}
