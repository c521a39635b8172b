"""Maps of a scenario: obstacles, inflation and costs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from omnidrive.errors import InvalidInput, OmnidriveError
from omnidrive.maps import CostMap, Lane, OccupancyGrid, load_costs, load_map, paper_map, paper_wall
from omnidrive.reference import ReferencePath
from omnidrive.robot import Robot
from omnidrive.scenario.cost_section import CostSection
from omnidrive.scenario.sections import MapSection

_FLOOR_CELLS = 200
"""Largest number of cells of an open floor along x and y; the plants do not use them."""


def grids_of(section: MapSection) -> tuple[OccupancyGrid, OccupancyGrid]:
    """Return the map of the obstacles, and that for planning."""
    if section.source == "paper":
        return paper_wall(), paper_map()
    grid = load_map(section.source, resolution=section.resolution, unknown=section.unknown)
    return grid, grid


def inflation_of(section: MapSection, grid: OccupancyGrid, robot: Robot) -> tuple[float, str]:
    """Return the distance of the robot's centre from obstacles, m, and a note on its parts.

    It holds for cell centres; a point of a cell is half a diagonal from its centre.
    """
    if section.source == "paper":
        return section.margin, "the margin; the paper's map contains that of the robot"
    half_diagonal = grid.resolution * 0.5**0.5
    inflation = robot.body_radius + max(section.margin, half_diagonal)
    body = f"the body radius of {robot.body_radius:g} m"
    if half_diagonal <= section.margin:
        return inflation, f"{body} and the margin of {section.margin:g} m"
    return inflation, (
        f"{body} and half a cell diagonal, {half_diagonal:.3g} m, which is larger than the margin "
        f"of {section.margin:g} m"
    )


def open_floor(path: ReferencePath, robot: Robot) -> OccupancyGrid:
    """Return a map without obstacles around a path, for pictures."""
    around = 2.0 * robot.body_radius + 0.5
    low, high = path.samples[:, :2].min(axis=0) - around, path.samples[:, :2].max(axis=0) + around
    cell = max(0.05, float((high - low).max()) / _FLOOR_CELLS)
    cols, rows = np.ceil((high - low) / cell).astype(int).tolist()
    x, y = low.tolist()
    return OccupancyGrid(np.zeros((rows, cols), dtype=bool), cell, (x, y), walled=False)


def costs_of(
    section: CostSection | None, grid: OccupancyGrid, robot: Robot, max_speed: float | None
) -> CostMap | None:
    """Return the costs of the section, without those around obstacles; None: no costs.

    Percents of a speed mask are those of ``max_speed`` (m/s), by default of the largest speed of
    the robot straight ahead.

    Raises:
        InvalidMap: A mask cannot be read, or its size or frame is not that of the map.
        InvalidInput: A value is not possible. Of several faults, the message names all.
    """
    if section is None:
        return None
    straight = float(np.abs(robot.chassis.jacobian[:, 0]).max())
    top = max_speed or robot.max_wheel_speed / straight
    layers: tuple[tuple[str | None, Callable[[CostMap, str], CostMap]], ...] = (
        (section.keepout, lambda under, file: under.with_keepout(file)),
        (section.speed, lambda under, file: under.with_speed_mask(file, top)),
        (section.costs, lambda under, file: under.with_costs(load_costs(file, grid))),
    )
    costs, faults = CostMap.of(grid), []
    for file, added in layers:
        try:
            costs = costs if file is None else added(costs, file)
        except OmnidriveError as error:
            faults.append(error)
    if len(faults) > 1:
        raise InvalidInput("; ".join(map(str, faults)))
    if faults:
        raise faults[0]
    return costs.with_lanes([Lane(*each.model_dump().values()) for each in section.lanes])
