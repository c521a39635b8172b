"""The option ``--fault`` of the verbs ``compare`` and ``run``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, get_args

from omnidrive import scenario as scenarios
from omnidrive.choices import FaultKind
from omnidrive.cli.completion import one_of
from omnidrive.cli.options import RUN_PANEL, option

FaultOption = Annotated[
    list[str] | None,
    option(
        "KIND[:NAME=VALUE,...]",
        "Inject a fault or disturbance, such as wheel-dead:wheel=2,at=5; can be repeated. "
        f"Kinds: {', '.join(get_args(FaultKind))}.",
        RUN_PANEL,
        "--fault",
        complete=one_of(get_args(FaultKind)),
    ),
]


def with_faults(scenario: scenarios.Scenario, texts: Sequence[str] | None) -> scenarios.Scenario:
    """Return the scenario with the given faults.

    With a task ``faults``, each fault acts in a run of its own; otherwise all act in every run.

    Raises:
        InvalidInput: A text is not a fault, or a fault is not possible in this scenario.
    """
    if not texts:
        return scenario
    from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
    from omnidrive.simulation.disturbances import parse_fault

    faults = [parse_fault(text).model_dump() for text in texts]
    data = scenario_data(scenario)
    if data["tasks"]["faults"]:
        data["tasks"]["faults"]["faults"] = faults
    else:
        data["faults"] = faults
    return parse_scenario(data, "with these faults")
