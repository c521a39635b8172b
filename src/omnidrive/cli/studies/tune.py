"""``omnidrive tune``: search for better parameters of a controller."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from omnidrive import scenario as scenarios
from omnidrive import study
from omnidrive.cli.completion import component
from omnidrive.cli.components import with_controllers
from omnidrive.cli.input_kind import FUZZY_SUFFIXES
from omnidrive.cli.options import (
    RESULTS_PANEL,
    RUN_PANEL,
    available_cores,
    default_folder,
    option,
)
from omnidrive.cli.scenario_options import ScenarioOptions, with_options
from omnidrive.errors import InvalidInput, one_line
from omnidrive.files.number_text import parse_number

_PANEL = "Tuning"
_ControllerOption = Annotated[
    str | None,
    option(
        "[LABEL=]NAME[,KEY=VALUE...]",
        "Controller to tune, from the values of its parameters given here: its label in the "
        "scenario, its name, a file of `tune` (.yaml), or your own as FILE.py:NAME.",
        _PANEL,
        complete=component("controllers"),
    ),
]
_ObjectiveOption = Annotated[
    list[str] | None,
    option(
        "SUM",
        "What is minimised: a sum of metrics in the units of the tables, such as `me+0.1*effort` "
        "(mm and rad/s²), or `balanced`: the mean change of the errors on two kinds of references "
        "and of a step response, none of which may grow [default: balanced]. Given several times: "
        "a front (NSGA-II).",
        _PANEL,
    ),
]
_LimitOption = Annotated[
    list[str] | None,
    option(
        "METRIC<=VALUE",
        "Hard limit of every training run, such as `max_error<=0.3m` (repeatable). Runs must also "
        "reach the end of their reference.",
        _PANEL,
    ),
]
_ParametersOption = Annotated[
    str | None,
    option(
        "A,B,...",
        "Only these parameters: names and patterns such as `position.*`; with ! left out. `*`: "
        "all, also the consequents of fuzzy rules [default: all but those].",
        _PANEL,
    ),
]
_RangeOption = Annotated[
    list[str] | None,
    option("NAME=LOW:HIGH", "Narrower range of a parameter (repeatable).", _PANEL),
]
_TrialsOption = Annotated[
    int | None, option("N", "Largest number of trials [default: 200].", _PANEL, minimum=2)
]
_MinutesOption = Annotated[
    float | None,
    option("MIN", "Largest time of the search, min [default: no limit].", _PANEL),
]
_TrainingOption = Annotated[
    Path | None,
    option(
        "STUDY",
        "Study file with the training runs [default: those of the task `track`, for `balanced` "
        "also another reference and a step, with two robots that differ by up to 10 %].",
        _PANEL,
    ),
]
_HeldOutOption = Annotated[
    Path | None,
    option(
        "STUDY",
        "Study file with the runs that measure the gain [default: other references, steps, robots "
        "and seeds].",
        _PANEL,
    ),
]
_JobsOption = Annotated[
    int | None,
    option("N", "Number of parallel runs [default: all cores].", RUN_PANEL, minimum=1),
]
_OutOption = Annotated[
    Path | None,
    option(
        "FOLDER",
        "New folder, or that of the same tuning, which continues [default: "
        "runs/tune-CONTROLLER-TIME].",
        RESULTS_PANEL,
        "--out",
    ),
]


@with_options()
def tune(
    shared: ScenarioOptions,
    controller: _ControllerOption = None,
    objective: _ObjectiveOption = None,
    limit: _LimitOption = None,
    parameters: _ParametersOption = None,
    range: _RangeOption = None,
    trials: _TrialsOption = None,
    minutes: _MinutesOption = None,
    training: _TrainingOption = None,
    held_out: _HeldOutOption = None,
    jobs: _JobsOption = None,
    out: _OutOption = None,
) -> None:
    """Search for better parameters of a controller, and measure the gain on other runs.

    The tuned parameters are all numbers with bounds, of your own controllers too. CMA-ES minimises
    one objective, NSGA-II finds the front of several. The gain is measured on held-out runs with
    other references, robots and seeds, with a confidence interval; what is worse is marked.

    The folder holds the tuned controller, parameters.yaml, which `--controller FILE` of compare and
    run takes and scenarios name; trials.csv; and report.html. An interrupted search continues with
    `omnidrive tune FOLDER`. Needs the extra `tuning`.

    For example:

    * `omnidrive tune paper --controller fuzzy_t1 --objective me+0.1*effort --trials 300`
    * `omnidrive tune --controller pid --objective me --objective effort --minutes 10`
    * `omnidrive tune --controller mine.py:MyController --limit "max_error<=0.2m"`
    * `omnidrive compare --controller runs/tuned/parameters.yaml --controller fuzzy_t1`
    """
    from omnidrive import tuning
    from omnidrive.cli.tables import print_tables
    from omnidrive.cli.terminal import conclude

    folder = Path(shared.scenario)
    given: dict[str, Any] = {"trials": trials, "minutes": minutes}
    if (folder / "tuning.yaml").is_file():
        problem = tuning.load_tuning(folder, allow_code=shared.allow_code, **given)
    else:
        _check_is_scenario(shared.scenario)
        scenario, label = _with_controller(
            shared.resolve(), controller, allow_code=shared.allow_code
        )
        given |= {"objectives": objective, "limits": limit, "parameters": parameters}
        problem = tuning.Tuning.of(
            scenario,
            tuning.settings_of(_settings(scenario, label, range or (), given)),
            training=_study(training, shared),
            held_out=_study(held_out, shared),
        )
        folder = out or default_folder(f"tune-{label}")
    with TuningProgress() as progress:
        result = tuning.tune(
            problem, folder, processes=jobs or available_cores(), report=progress.report
        )
        for _ in tuning.write_tuning(result):
            pass
    print_tables(sorted(tuning.tuning_tables(result), key=lambda each: not each.is_detail))
    conclude(f"results: {folder} (open {folder / 'report.html'})")


class TuningProgress:
    """Progress of tuning in a terminal."""

    def __init__(self) -> None:
        from omnidrive.cli.progress import LiveProgress

        self._live = LiveProgress()
        self._part, self._done = "", 0

    def __enter__(self) -> TuningProgress:
        self._live.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._live.__exit__(*error)

    def report(self, part: str, done: int, total: int, best: str) -> None:
        """Show the progress of a part."""
        if part != self._part:
            self._live.part(part, total)
            self._part, self._done = part, 0
        while self._done < done:
            self._live.done(best)
            self._done += 1


def _check_is_scenario(name: str) -> None:
    """Raise InvalidInput if the argument names the file of a fuzzy system."""
    if Path(name).suffix.lower() in FUZZY_SUFFIXES:
        file = one_line(name, 60)
        raise InvalidInput(
            f"{file} is a fuzzy system, not a scenario. Parameters of controllers are tuned: with "
            "--controller fuzzy_t1 gains and sets, with also --parameters '*' the rules; with "
            f"--controller fuzzy_t1,fuzzy.file={file} the gains around the system in the file"
        )


def _with_controller(
    scenario: scenarios.Scenario, text: str | None, *, allow_code: bool
) -> tuple[scenarios.Scenario, str]:
    """Return the scenario with the controller to tune, and its label."""
    if text is not None:
        scenario = with_controllers(scenario, [text], allow_code=allow_code)
    elif len(scenario.controllers) > 1:
        raise InvalidInput(
            f"--controller is needed: the scenario has {', '.join(scenario.controllers)}"
        )
    return scenario, next(iter(scenario.controllers))


def _settings(
    scenario: scenarios.Scenario, label: str, ranges: Sequence[str], given: dict[str, Any]
) -> dict[str, Any]:
    """Return the settings of tuning; None: the default."""
    patterns = given["parameters"]
    return {
        **given,
        "controller": label,
        "parameters": patterns.split(",") if patterns else None,
        "ranges": dict(map(_range, ranges)) or None,
        "seed": scenario.seed % 2**32,
    }


def _range(text: str) -> tuple[str, tuple[float, float]]:
    """Parse ``NAME=LOW:HIGH``."""
    name, equals, span = text.partition("=")
    numbers = [parse_number(each.strip()) for each in span.split(":")]
    if not equals or len(numbers) != 2 or None in numbers:
        raise InvalidInput(f"--range must be NAME=LOW:HIGH, such as position.kp=1:20; got '{text}'")
    low, high = (float(each) for each in numbers if each is not None)
    return name.strip(), (low, high)


def _study(file: Path | None, shared: ScenarioOptions) -> study.StudyDefinition | None:
    return None if file is None else study.load_definition(file, allow_code=shared.allow_code)
