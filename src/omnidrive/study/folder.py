"""Output folder of a study; each file is complete or absent."""

from __future__ import annotations

from contextlib import AbstractContextManager, suppress
from itertools import count
from pathlib import Path
from shutil import copyfile

from omnidrive.choices import WAYPOINTS
from omnidrive.components import configure
from omnidrive.files.output_file import create_folder, output_file, remove_abandoned, write_errors
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.maps import save_nav2_map
from omnidrive.robot import is_robot_file, save_robot
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_file import save_scenario
from omnidrive.scenario.sections import RobotSection
from omnidrive.simulation import Run
from omnidrive.study.output_paths import check_study_folder

ADVICE = "files written before are kept; free disk space, or choose another folder with --out"
"""What a message about a file that cannot be written advises."""


class RunFolder:
    """Writer of the results of a study; the folder is readable at any time during the study.

    Attributes:
        path: The folder.
    """

    def __init__(self, path: StrPath, *, numbered: bool = False) -> None:
        """Create the folder.

        Args:
            path: The folder.
            numbered: Whether to append -2, -3, ... to the name of a folder that exists. A name is
                taken by creating the folder, so that commands may start at the same time.

        Raises:
            CannotWrite: It cannot be created, or holds other files than those of a study.
        """
        self.path = to_path(path)
        if not numbered:
            check_study_folder(self.path)
        with write_errors(self.path, ADVICE):
            if numbered:
                self.path = _numbered_folder(self.path)
            else:
                self.path.mkdir(parents=True, exist_ok=True)

    def save_inputs(self, planned: PlannedScenario) -> None:
        """Write the scenario and copies of its map, robot and waypoint files.

        Raises:
            CannotWrite: A file cannot be written.
        """
        if planned.scenario.map.is_file:
            save_nav2_map(planned.obstacles, self.path / "map.yaml")
        waypoints = _waypoint_file(planned.scenario)
        if waypoints:
            with self._file(f"waypoints{waypoints.suffix}") as part:
                copyfile(waypoints, part)
        for key in _robot_files(planned.scenario):
            save_robot(getattr(planned, key), self.path / f"{key}.yaml")
        save_scenario(portable(planned.scenario), self.path / "scenario.yaml")

    def save_series(self, name: str, run: Run) -> None:
        """Write the time series of a run to ``series/NAME.parquet``.

        Raises:
            CannotWrite: The file cannot be written.
        """
        create_folder(self.path / "series")
        run.save(self.path / f"series/{name}.parquet")

    def _file(self, name: str) -> AbstractContextManager[Path]:
        """Return the context of :func:`output_file` for a file of the folder."""
        return output_file(self.path / name, ADVICE)


def _numbered_folder(path: Path) -> Path:
    """Create the folder ``path``, or with -2, -3, ... after its name; return the created one.

    Temporary files of killed commands are removed from the unfinished folders beside it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for other in path.parent.iterdir():
        if other.is_dir() and not (other / "report.html").exists():
            remove_abandoned(other)
    for number in count(1):
        found = path if number == 1 else path.with_name(f"{path.name}-{number}")
        with suppress(FileExistsError):
            found.mkdir()
            return found
    raise AssertionError


def portable(scenario: Scenario) -> Scenario:
    """Return the scenario with the copies of its files in the run folder."""
    changes: dict[str, object] = {}
    waypoints = _waypoint_file(scenario)
    if waypoints:
        file = f"waypoints{waypoints.suffix}"
        changes["reference"] = configure("references", WAYPOINTS, {"file": file})
    if scenario.map.is_file:
        copy = {"source": "map.yaml", "resolution": None}
        changes["map"] = scenario.map.model_copy(update=copy)
    for key, section in _robot_files(scenario).items():
        changes[key] = section.model_copy(update={"name": f"{key}.yaml"})
    return scenario.model_copy(update=changes)


def _waypoint_file(scenario: Scenario) -> Path | None:
    """Return the waypoint file of the scenario's reference; None for another reference."""
    reference = scenario.reference
    if reference == "path" or reference.type != WAYPOINTS:
        return None
    return Path(reference.values["file"])


def _robot_files(scenario: Scenario) -> dict[str, RobotSection]:
    """Return the sections of the scenario that name a robot file, by key."""
    sections = {"robot": scenario.robot, "plant_robot": scenario.plant_robot}
    return {key: each for key, each in sections.items() if each and is_robot_file(each.name)}
