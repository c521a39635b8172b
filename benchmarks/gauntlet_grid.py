"""Grid of the gauntlet: which cells it runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache

from gauntlet_cases import ALL_CASES, CASES, LINK_CASES, PAIRS
from gauntlet_cells import (
    CONTROLLERS,
    FAULT_KINDS,
    RECOMMENDED,
    STUDY_DT,
    UNADAPTED,
    Cell,
    study_runs,
)
from gauntlet_references import IMPOSSIBLE, LINK_SHAPES, SHAPES, STEPS
from gauntlet_sample import Drawn, sample

from omnidrive.robot import ROBOTS

RIVALS = ("pid", "fuzzy_t3", "feedforward", "lqr", "sliding-mode", "adrc")
"""The other controllers that run by default, except in the parts ``noise`` and ``study``.

In 43 random groups of ``tracking`` and ``link`` with all controllers, one of these was the best in
ME and in MAE, or within 0.1 % of the best, another fuzzy one."""
PLANTS = ("ball", "rollers")
LINK_PLANTS = {"planar": 5, "ball": 5, "rollers": 2}
"""Plants of the parts ``link`` and ``link-steps``, with their shares."""
DTS = (0.02, 0.05, 0.1)  # s
PER_CASE, PER_PAIR, PER_FORMER_CASE = 12, 4, 15
"""Groups of each case: of the parts ``link`` and ``link-steps``, of pairs there, and of the parts
``tracking`` and ``step-cases``, which have 72 and 48 of each."""
SEED = 34
PARTS = (
    "step", "step-cases", "tracking", "link", "link-steps",
    "faults", "impossible", "noise", "study",
)  # fmt: skip


@cache
def groups_of_part(part: str) -> list[Drawn]:
    """Return the groups of a part of which a sample is run."""
    if part in ("link", "link-steps"):
        cases = dict.fromkeys(LINK_CASES, PER_CASE) | dict.fromkeys(PAIRS, PER_PAIR)
        plants, references = LINK_PLANTS, LINK_SHAPES if part == "link" else STEPS
    else:
        cases, plants = dict.fromkeys(CASES, PER_FORMER_CASE), {"ball": 1}
        references = SHAPES if part == "tracking" else STEPS
        if part == "step-cases":
            del cases["nominal"]
    return sample(
        cases,
        robots=tuple(ROBOTS),
        dts=DTS,
        plants=plants,
        references=tuple(references),
        seed=SEED,
    )


@dataclass(frozen=True)
class Grid:
    """Selection of cells."""

    parts: tuple[str, ...] = PARTS
    robots: tuple[str, ...] = tuple(ROBOTS)
    dts: tuple[float, ...] = DTS
    plants: tuple[str, ...] = tuple(dict.fromkeys((*PLANTS, *LINK_PLANTS)))
    cases: tuple[str, ...] = tuple(ALL_CASES)
    references: tuple[str, ...] = (*SHAPES, *STEPS, *LINK_SHAPES)
    controllers: tuple[str, ...] = (RECOMMENDED, *RIVALS, UNADAPTED)

    def with_values(self, **values) -> Grid:
        """Return the grid with those values that are not None."""
        given = {f.name: values[f.name] for f in fields(self) if values.get(f.name) is not None}
        return replace(self, **given)

    def cells(self) -> list[Cell]:
        """Return the cells, each controller next to those that it is compared with."""
        every = []
        for part in self.parts:
            every += getattr(self, f"_{part.replace('-', '_')}")()
        return list(dict.fromkeys(every))

    def _product(self, part, plants, cases, references, controllers=CONTROLLERS):
        return [
            Cell(part, robot, dt, plant, case, reference, 0, controller)
            for plant in self.plants if plant in plants
            for robot in self.robots
            for dt in self.dts
            for case in cases
            for reference in references
            for controller in self.controllers if controller in controllers
        ]  # fmt: skip

    def _sampled(self, part: str, controllers: Sequence[str], nominal: Sequence[str] = ()):
        """Return the cells of a random sample of groups, the same ones in every selection.

        ``nominal``: controllers that also run without a difference, for comparison.
        """
        cells = []
        for group in filter(self._selects, groups_of_part(part)):
            for case, names in (("nominal", nominal), (group.case, controllers)):
                same = part, *group._replace(case=case), 0
                cells += [Cell(*same, name) for name in self.controllers if name in names]
        return cells

    def _selects(self, group: Drawn) -> bool:
        return (
            group.robot in self.robots
            and group.dt in self.dts
            and group.plant in self.plants
            and group.case in self.cases
            and group.reference in self.references
        )

    def _step(self):
        steps = [name for name in self.references if name in STEPS]
        return self._product("step", PLANTS, ("nominal",), steps)

    def _step_cases(self):
        return self._sampled("step-cases", CONTROLLERS)

    def _tracking(self):
        return self._sampled("tracking", CONTROLLERS, (RECOMMENDED,))

    def _link(self):
        own = RECOMMENDED, UNADAPTED
        return self._sampled("link", (*CONTROLLERS, UNADAPTED), own)

    def _link_steps(self):
        return self._sampled("link-steps", (*CONTROLLERS, UNADAPTED))

    def _faults(self):
        own = self._product("faults", PLANTS, FAULT_KINDS, ["eight"])
        return own + self._of_study("faults", PLANTS, range(1, len(FAULT_KINDS) + 1))

    def _impossible(self):
        return self._product("impossible", PLANTS, ("nominal",), [IMPOSSIBLE], (RECOMMENDED,))

    def _noise(self):
        return self._of_study("noise", PLANTS)

    def _study(self):
        return self._of_study("study", ["rollers"])

    def _of_study(self, part, plants, faults=()):
        """Return the runs of the paper's study: its robot, sample time and path."""
        if "paper" not in self.robots or STUDY_DT not in self.dts:
            return []
        cells = [
            cell
            for plant in plants if plant in self.plants
            for preset in (("paper", "recommended") if part == "study" else ("recommended",))
            for cell, settings in study_runs(part, plant, preset).items()
            if not faults or settings.fault in faults
        ]  # fmt: skip
        whole = part != "faults" and self.controllers == Grid().controllers
        return [cell for cell in cells if whole or cell.controller in self.controllers]
