"""Controllers with parameters, and records of runs that were not simulated."""

from dataclasses import dataclass, field
from typing import Annotated

from omnidrive.components import Configured
from omnidrive.components.component import Component
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.parameter import Bounds


@dataclass(frozen=True)
class Weights:
    position: Annotated[float, Bounds(0.01, 100.0, "1/m^2")] = 1.0
    offset: Annotated[float, Bounds(-1.0, 1.0, "m")] = 0.0


@dataclass(frozen=True)
class LqrParameters:
    """Parameters of a controller of another distribution."""

    gains: tuple[Annotated[float, Bounds(0.0, 10.0)], ...] = (1.0, 2.0)
    steps: Annotated[int, Bounds(1, 6, "steps")] = 3
    weights: Weights = field(default_factory=Weights)
    limit: Annotated[float, Bounds(0.0, float("inf"), "m/s")] | None = 2.0
    absent: Annotated[float, Bounds(0.0, 1.0)] | None = None
    unbounded: float = 1.0
    name: str = "a"
    on: bool = True

    def __post_init__(self):
        if self.gains[0] > 9.0:
            raise ValueError("the first gain is too large")


class Lqr:
    """A controller of another distribution."""

    def __init__(self, context, parameters: LqrParameters):
        self.parameters = parameters

    def reset(self, state):
        """Do nothing."""

    def step(self, t, state, reference):
        """Do nothing."""


def lqr(**values):
    component = Component("controllers", "tests:Lqr", "Python object", Lqr)
    return Configured(component, component.parse(values))


def record(number=0, *, finished=True, controller="lqr", repetition=0, **metrics):
    return RunRecord(
        number=number, key=f"{number:064x}", pairing=number, controller=controller, task="track",
        repetition=repetition, factors={}, outcome="finished" if finished else "failed",
        finished=finished, metrics=metrics, timing={}, detail="",
    )  # fmt: skip
