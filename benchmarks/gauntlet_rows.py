"""Rows of the gauntlet: what must hold, each with its worst cell."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf, isfinite, isnan, nan
from statistics import fmean
from typing import NamedTuple

from gauntlet_cells import FAULT_KINDS, RECOMMENDED, UNADAPTED, Cell, Figures
from gauntlet_table import FLOORS, Table

STEP_OVERSHOOT, CASE_OVERSHOOT = 1.0, 5.0  # %
OVER_NOMINAL, OVER_OTHERS = 2.0, 0.8
PATH_DISTANCE, PATH_HEADING, ARRIVAL = 15.0, 30.0, 0.05  # mm, mrad, share of the exact arrival
NOISE, STUDY = 1.02, 1.02
LINK_OTHERS, LINK_NOMINAL, LINK_SETTLING = (1.05, 0.05), (3.0, 1.0), 1.1
"""Of the parts ``link`` and ``link-steps``: the first two are a factor, and what is allowed in any
case: mm or mrad, more than the other for the first and altogether for the second."""
REVERSALS = 0.1
TINY = 1e-9
NEGLIGIBLE = 0.1
"""mm or mrad; of cells that compare errors, those that fail by more are counted as well."""


class Comparison(NamedTuple):
    """Value of one group of cells, with its explanation."""

    value: float
    cell: Cell
    text: str
    scale: float = nan
    """What the value is a multiple of, in mm or mrad; NaN for other rows."""


@dataclass(frozen=True)
class Row:
    """Largest value over all groups of cells, and its limit."""

    name: str
    part: str
    unit: str
    limit: float
    values: Callable[[list[Group], Table], Iterator[Comparison]]

    def entry(self, groups: list[Group], study: Table) -> dict[str, object] | None:
        """Return name, value, target, whether it holds, and the cells; None: no cells.

        ``study``: figures of the paper's study at an earlier commit.
        """
        found = list(self.values([g for g in groups if g.part == self.part], study))
        if not found:
            return None
        found.sort(key=lambda each: -inf if isnan(each.value) else -each.value)
        failing = [each for each in found if not each.value <= self.limit + TINY]
        return {
            "name": self.name,
            "value": float(f"{found[0].value:.4g}"),
            "unit": self.unit,
            "target": f"<= {self.limit:g}",
            "holds": not failing,
            "failing": [f"{each.value:.4g} {_place(each)}: {each.text}" for each in failing],
            "clearly": sum(not (e.value - self.limit) * e.scale <= NEGLIGIBLE for e in failing),
            "cells": len(found),
            "worst": f"{_place(found[0])}: {found[0].text}",
        }


def _place(worst: Comparison) -> str:
    cell = worst.cell
    seed = [] if cell.part != "noise" else [f"{worst.cell.seed + 1} seeds"]
    return ", ".join([cell.robot, f"{cell.dt:g} s", cell.plant, cell.case, cell.reference, *seed])


@dataclass(frozen=True)
class Group:
    """Cells that differ in the controller only."""

    cell: Cell
    figures: dict[str, Figures]

    @property
    def part(self) -> str:
        return self.cell.part

    @property
    def own(self) -> Figures | None:
        return self.figures.get(RECOMMENDED)

    @property
    def others(self) -> dict[str, Figures]:
        own = RECOMMENDED, UNADAPTED
        return {name: each for name, each in self.figures.items() if name not in own}


def groups_of(table: Table) -> list[Group]:
    groups: dict[Cell, dict[str, Figures]] = {}
    for cell, figures in table.items():
        groups.setdefault(cell._replace(controller=RECOMMENDED), {})[cell.controller] = figures
    return [Group(cell, figures) for cell, figures in groups.items()]


def best(group: Group, figure: str) -> tuple[float, str]:
    """Return the least value of the other controllers, and whose it is."""
    values = [(getattr(each, figure), name) for name, each in group.others.items()]
    finite = [each for each in values if isfinite(each[0])]
    return min(finite, default=(inf, "none"))


def quotient(value: float, reference: float) -> float:
    """Return value over reference, which may be zero."""
    if reference > 0.0:
        return value / reference if isfinite(reference) else 0.0 if isfinite(value) else inf
    return 1.0 if value == 0.0 else inf


def absolute(figure: str):
    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        for group in groups:
            if group.own is not None:
                value = getattr(group.own, figure)
                yield Comparison(value, group.cell, f"{value:.4g}")

    return values


def over_others(figure: str, cases: tuple[str, ...] | None = None):
    """Compare with the best other controller."""

    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        for group in groups:
            if group.own is None or not group.others or (cases and group.cell.case not in cases):
                continue
            value, (least, name) = getattr(group.own, figure), best(group, figure)
            text = f"{value:.4g}, {name} {least:.4g}"
            yield Comparison(quotient(value, least), group.cell, text, least)

    return values


def over_nominal(figure: str):
    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        nominal = {g.cell: getattr(g.own, figure) for g in groups if g.own is not None}
        for group in groups:
            base = nominal.get(group.cell._replace(case="nominal"))
            if group.own is None or base is None or group.cell.case == "nominal":
                continue
            value = getattr(group.own, figure)
            text = f"{value:.4g}, nominal {base:.4g}"
            yield Comparison(quotient(value, base), group.cell, text, base)

    return values


def settling(overshoot: float):
    """Compare with the fastest other controller that overshoots by at most ``overshoot`` %."""

    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        for group in groups:
            able = [
                (each.settling_s, name)
                for name, each in group.others.items()
                if each.overshoot_percent <= overshoot and isfinite(each.settling_s)
            ]
            if group.own is not None and able:
                value, (least, name) = group.own.settling_s, min(able)
                text = f"{value:.3g} s, {name} {least:.3g} s"
                yield Comparison(quotient(value, least), group.cell, text)

    return values


def link_others(figure: str, only: str | None = None):
    """Compare with the limit that the best other, or ``only`` this one, sets."""

    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        factor, difference = LINK_OTHERS
        for group in groups:
            least, name = best(group, figure)
            if only is not None:
                least, name = getattr(group.figures.get(only), figure, nan), only
            if group.own is None or isnan(least) or name == "none":
                continue
            value, limit = getattr(group.own, figure), max(factor * least, least + difference)
            text = f"{value:.4g}, {name} {least:.4g}"
            yield Comparison(quotient(value, limit), group.cell, text, limit)

    return values


def link_nominal(figure: str):
    """Compare with the limit that the same run without a difference sets."""

    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        factor, allowed = LINK_NOMINAL
        for each in over_nominal(figure)(groups, study):
            value = each.value * each.scale
            limit = max(factor * each.scale, allowed)
            yield each._replace(value=quotient(value, limit), scale=limit)

    return values


def case_overshoot(groups: list[Group], study: Table) -> Iterator[Comparison]:
    """Compare with 5 %, or half the overshoot of the best other that settles, if that is more."""
    for group in groups:
        if group.own is None:
            continue
        others = [
            (each.overshoot_percent, name)
            for name, each in group.others.items()
            if isfinite(each.settling_s)
        ]
        least, name = min(others, default=(0.0, "none"))
        value, limit = group.own.overshoot_percent, max(CASE_OVERSHOOT, 0.5 * least)
        yield Comparison(value / limit, group.cell, f"{value:.3g} %, {name} {least:.3g} %")


def lateness(groups: list[Group], study: Table) -> Iterator[Comparison]:
    for group in groups:
        if group.own is not None:
            value = group.own.arrival
            yield Comparison(abs(value - 1.0), group.cell, f"{value:.4g} of the exact time")


def over_seeds(figure: str):
    """Compare means over the seeds of the noise with those of the best other controller."""

    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        seeds: dict[Cell, dict[str, list[float]]] = {}
        for group in sorted(groups, key=lambda each: each.cell.seed):
            means = seeds.setdefault(group.cell._replace(seed=0), {})
            for name, each in group.figures.items():
                means.setdefault(name, []).append(getattr(each, figure))
        for cell, found in seeds.items():
            count = len(found.get(RECOMMENDED, ()))
            others = [
                (fmean(each), name)
                for name, each in found.items()
                if name != RECOMMENDED and len(each) == count
            ]
            if count and others:
                value, (least, name) = fmean(found[RECOMMENDED]), min(others)
                text = f"{value:.4g}, {name} {least:.4g}"
                yield Comparison(quotient(value, least), cell._replace(seed=count - 1), text)

    return values


COMPARED = ("me_mm", "mae_mrad", "max_mm", "overshoot_percent", "settling_s")


def over_earlier(only: tuple[str, ...] = COMPARED, task: str = ""):
    """Compare every controller with its figures at an earlier commit."""

    def values(groups: list[Group], study: Table) -> Iterator[Comparison]:
        for group in groups:
            if not group.cell.reference.startswith(task):
                continue
            for name, figures in group.figures.items():
                earlier = study.get(group.cell._replace(controller=name))
                for figure in only if earlier else ():
                    new, old = getattr(figures, figure), getattr(earlier, figure)
                    if not isnan(new) and new - old > 0.1 * FLOORS[figure]:  # not by rounding
                        text = f"{name} {figure} {new:.4g}, before {old:.4g}"
                        yield Comparison(quotient(new, old), group.cell, text)
                    elif not isnan(new):
                        yield Comparison(
                            min(quotient(new, old), 1.0), group.cell, f"{name} {new:.4g}"
                        )

    return values


ERRORS = {"ME": "me_mm", "MAE": "mae_mrad"}
ROWS = (
    Row("step: overshoot", "step", "%", STEP_OVERSHOOT, absolute("overshoot_percent")),
    Row("step: settling over that of the fastest other", "step", "1", 1.0,
        settling(STEP_OVERSHOOT)),
    Row("step in other cases: overshoot over its limit", "step-cases", "1", 1.0, case_overshoot),
    Row("tracking: ME over nominal", "tracking", "1", OVER_NOMINAL, over_nominal("me_mm")),
    Row("tracking: MAE over nominal", "tracking", "1", OVER_NOMINAL, over_nominal("mae_mrad")),
    Row("tracking: ME over the best other", "tracking", "1", OVER_OTHERS, over_others("me_mm")),
    Row("tracking: MAE over the best other", "tracking", "1", OVER_OTHERS,
        over_others("mae_mrad")),
    *(Row(f"link: {name} over its limit by the best other", "link", "1", 1.0, link_others(figure))
      for name, figure in ERRORS.items()),
    *(Row(f"link: {name} over its limit by the nominal run", "link", "1", 1.0, link_nominal(figure))
      for name, figure in ERRORS.items()),
    *(Row(f"link: {name} over its limit by adapt: false", "link", "1", 1.0,
          link_others(figure, UNADAPTED)) for name, figure in ERRORS.items()),
    Row("link-steps: overshoot", "link-steps", "%", CASE_OVERSHOOT, absolute("overshoot_percent")),
    Row("link-steps: settling over that of the fastest other", "link-steps", "1", LINK_SETTLING,
        settling(CASE_OVERSHOOT)),
    *(Row(f"{part}: {name}", part, "1", limit, absolute(figure))
      for part in ("link", "link-steps")
      for name, limit, figure in (("share of reversals of the command", REVERSALS, "reversals"),
                                  ("estimates at a bound in the end", 0.0, "at_bounds"))),
    *(Row(f"fault {kind}: worst error over the best other", "faults", "1", 1.0,
          over_others("max_mm", (kind,))) for kind in FAULT_KINDS),
    Row("eight in 8 s: ME to the path", "impossible", "mm", PATH_DISTANCE, absolute("me_mm")),
    Row("eight in 8 s: heading on the path", "impossible", "mrad", PATH_HEADING,
        absolute("mae_mrad")),
    Row("eight in 8 s: arrival, from the exact retiming", "impossible", "1", ARRIVAL, lateness),
    Row("task noise: ME over the best other", "noise", "1", NOISE, over_seeds("me_mm")),
    Row("task noise: MAE over the best other", "noise", "1", NOISE, over_seeds("mae_mrad")),
    Row("task noise: work over the best other", "noise", "1", NOISE, over_seeds("work_J")),
    Row("paper's study: any figure over that of before", "study", "1", STUDY, over_earlier()),
    Row("paper's study, noise: ME and MAE over those of before", "study", "1", 1.0,
        over_earlier(("me_mm", "mae_mrad"), "noise")),
)  # fmt: skip


def entries(table: Table, study: Table) -> list[dict[str, object]]:
    """Return the entries of all rows with cells."""
    groups = groups_of(table)
    found = [row.entry(groups, study) for row in ROWS]
    return [each for each in found if each is not None]
