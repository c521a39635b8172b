"""What goes wrong: the option that verbs share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from omnidrive.cli.options import RUN_PANEL, option
from omnidrive.simulation.faults import FAULTS, parse_fault
from omnidrive.study import Scenario
from omnidrive.study.scenario_file import parse_scenario, scenario_data

FaultOption = Annotated[
    list[str] | None,
    option(
        "KIND[:NAME=VALUE,...]",
        "Let something go wrong, such as wheel-dead:wheel=2,at=5; may be given again. "
        f"Kinds: {', '.join(FAULTS)}.",
        RUN_PANEL,
        "--fault",
    ),
]


def with_faults(scenario: Scenario, texts: Sequence[str] | None) -> Scenario:
    """Let faults act: one by one in the task `faults` if there is one, else all in every run.

    Raises:
        InvalidInput: One is not a fault, or cannot be in this scenario.
    """
    if not texts:
        return scenario
    faults = [parse_fault(text).model_dump() for text in texts]
    data = scenario_data(scenario)
    if data["tasks"]["faults"]:
        data["tasks"]["faults"]["faults"] = faults
    else:
        data["faults"] = faults
    return parse_scenario(data, "with these faults")
