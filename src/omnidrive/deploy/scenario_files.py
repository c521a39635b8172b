"""The scenario of a drive as files that are attached to its log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from omnidrive.deploy.attached_files import attached_files
from omnidrive.errors import InvalidLog
from omnidrive.scenario import Scenario, load_scenario
from omnidrive.study import RunFolder

PREFIX = "scenario/"
"""Beginning of the names of these files, so that they differ from the other files of a log."""
_NAME = "scenario.yaml"


def attached_inputs(folder: RunFolder) -> dict[str, bytes]:
    """Return what :meth:`RunFolder.save_inputs` wrote, for a log that is self-contained.

    The names begin with :data:`PREFIX`.
    """
    files = [path for path in sorted(folder.path.iterdir()) if path.is_file()]
    return {PREFIX + path.name: path.read_bytes() for path in files}


@contextmanager
def scenario_of_log(files: Mapping[str, bytes], *, allow_code: bool = False) -> Iterator[Scenario]:
    """Yield the scenario of a log; its files exist within the context only, in a new folder.

    Args:
        files: The files attached to the log.
        allow_code: Whether code may be imported that the scenario names and that is not installed.

    Raises:
        InvalidLog: There is no scenario, or its files are too many or have unusable names.
        InvalidScenario: The scenario is invalid.
    """
    inputs = {
        name.removeprefix(PREFIX): content
        for name, content in files.items()
        if name.startswith(PREFIX)
    }
    if _NAME not in inputs:
        raise InvalidLog(
            "the log holds no scenario, because the drive was started from Python; replay it with "
            "omnidrive.deploy.replay_log"
        )
    with attached_files(inputs) as folder:
        yield load_scenario(folder / _NAME, allow_code=allow_code)
