"""Execution of a study with its progress: one line on a terminal, plain lines elsewhere."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from time import monotonic

from rich.console import Console
from rich.live import Live
from rich.text import Text

from omnidrive.cli.compile_status import displays
from omnidrive.cli.options import available_cores
from omnidrive.cli.terminal import conclude, count_text, encodable, escaped, is_quiet, note, show
from omnidrive.errors import WorkerLost
from omnidrive.evaluation.stop_rule import StopRule
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.experiment import Progress
from omnidrive.study.output_paths import STORE_FILE
from omnidrive.study.run_experiment import run_experiment
from omnidrive.study.store import Store
from omnidrive.study.study_folder import resume_command
from omnidrive_command import check_interrupted

_LINES_EVERY = 10.0  # s between two lines that are not on a terminal


def execute_study(
    definition: StudyDefinition,
    folder: Path,
    *,
    jobs: int | None = None,
    run_timeout: float | None = None,
    until: str | None = None,
    scheduler: str | None = None,
    yes: bool = False,
) -> None:
    """Compute the runs that the folder does not hold yet; print progress and the number of runs.

    Args:
        definition: The study.
        folder: New folder, or that of the same study.
        jobs: Number of worker processes. None: one per core.
        run_timeout: Largest wall time of a run, s. None: no limit.
        until: Stop rule, such as me:0.1mm. None: the repetitions of the definition.
        scheduler: Address of a Dask scheduler. None: processes of this computer.
        yes: Whether the study may have more than ten million runs.

    Raises:
        OmnidriveError: See :func:`~omnidrive.study.run_experiment.run_experiment`.
    """
    rule = StopRule.parse(until) if until else None
    with continued_by(folder, definition), StudyProgress() as progress:
        run_experiment(
            definition,
            folder,
            processes=jobs or available_cores(),
            report=progress.report,
            note=progress.note,
            run_timeout=run_timeout,
            until=rule,
            scheduler=scheduler,
            confirmed=yes,
        )
    with Store(folder, read_only=True) as store:
        status = store.status()
    show(f"runs: {count_text(status.outcomes)}")
    for number, reason in status.failures:
        show(f"  run {number}: {reason}")
    report = shlex.join(["omnidrive", "study", "report", str(folder)])
    conclude(f"results: {folder} (report: {report})")


@contextmanager
def continued_by(folder: Path, definition: StudyDefinition) -> Iterator[None]:
    """Print how a study is continued that is interrupted, or loses its workers, in the context."""
    try:
        yield
    except (KeyboardInterrupt, WorkerLost):
        if (folder / STORE_FILE).is_file():
            command = resume_command(folder, allow_code=definition.names_code)
            note(f"continue with: {command}")
        raise


class StudyProgress:
    """Progress of a study on standard error, in a ``with`` statement; none with ``--quiet``."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._live = Live(
            Text(), console=self._console, transient=True, auto_refresh=False, redirect_stdout=False
        )
        self._next_line = monotonic() + _LINES_EVERY
        self._shown, self._note, self._compiling = "", "", ""

    def __enter__(self) -> StudyProgress:
        displays.append(self._show_compiling)
        if self._is_live:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        displays.remove(self._show_compiling)
        if self._is_live:
            self._live.stop()
        if self._shown:
            self._print(self._shown)

    def report(self, progress: Progress) -> None:
        """Show the progress; raise KeyboardInterrupt again if other code has caught it."""
        check_interrupted()
        self._shown = progress_text(progress)
        if self._is_live:
            self._refresh()
        elif monotonic() >= self._next_line and not is_quiet():
            self._next_line = monotonic() + _LINES_EVERY
            self._print(self._shown)

    def note(self, text: str) -> None:
        """Show what a stop rule says."""
        self._note = text
        if self._is_live:
            self._refresh()
        else:
            self._print(text)

    @property
    def _is_live(self) -> bool:
        """Whether the progress is one line that changes."""
        return self._console.is_terminal and not is_quiet()

    def _refresh(self) -> None:
        """Draw the line that changes."""
        parts = (self._shown, self._note, self._compiling)
        self._live.update(Text(escaped("; ".join(each for each in parts if each))), refresh=True)

    def _show_compiling(self, what: str) -> None:
        """Show what is being compiled; an empty text: nothing."""
        self._compiling = what
        if self._is_live:
            self._refresh()

    def _print(self, text: str) -> None:
        """Print a line unless the output is quiet."""
        if not is_quiet():
            print(encodable(text, sys.stderr.encoding), file=sys.stderr, flush=True)


def progress_text(progress: Progress) -> str:
    """Return the progress as one line."""
    share = 100.0 * progress.done / max(progress.total, 1)
    parts = [f"{progress.done:,} of {progress.total:,} runs ({share:.0f} %)"]
    if progress.unfinished:
        parts.append(f"{progress.unfinished:,} ended early")
    if progress.done < progress.total and isfinite(progress.remaining):
        parts.append(f"{_duration_text(progress.remaining)} left")
    if progress.best:
        name, mean = progress.best
        parts.append(f"best so far: {name}, mean ME {1e3 * mean:.3g} mm")
    return ", ".join(parts)


def _duration_text(seconds: float) -> str:
    """Return a time such as 45 s, 12 min or 3 h 20 min."""
    minutes = round(seconds / 60.0)
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
