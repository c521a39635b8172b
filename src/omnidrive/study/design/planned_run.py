"""One planned run of a study."""

from __future__ import annotations

from typing import Any, NamedTuple

from omnidrive.scenario.run_settings import RunSettings, run_name
from omnidrive.scenario.scenario import Scenario
from omnidrive.study.design.run_key import PlanKeys


class PlannedRun(NamedTuple):
    """One run of a study, before it is simulated."""

    number: int
    """Index in the plan, from 0."""
    key: str
    """SHA-256, in hexadecimal digits, of all that the run depends on; equal keys: equal runs."""
    pairing: int
    """Index of all factors but the controller: runs with the same one are compared in pairs."""
    factors: dict[str, Any]
    """Value of each axis and each random factor, by its dotted path in the scenario."""
    scenario: Scenario
    """The scenario with these values."""
    settings: RunSettings
    """Task, controller, duration, horizon, repeat and fault of the run of that scenario."""
    repetition: int = 0
    """Index of the repetition, from 0."""
    refused: str = ""
    """Why its values are not possible together; empty: they are. The scenario is then the base."""
    plan_keys: PlanKeys = PlanKeys()
    """Keys of its motion and of its simulated robot: runs with equal ones share them."""
    nominal: str = ""
    """In the task `faults`: the key of the run without a fault."""

    @property
    def name(self) -> str:
        """Name of the run in its scenario, such as ``track-pid-20s``."""
        return run_name(self.scenario, self.settings)
