"""Execution of planned runs, block by block, in any process."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any, TypeVar, get_args

from omnidrive import visualization  # imports only the modules in use
from omnidrive.components.fields import plain
from omnidrive.errors import OmnidriveError, PlantLost
from omnidrive.evaluation.measures.recovery import Recovery, recovery
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.execution.engine import is_worker
from omnidrive.parameter import check_choice
from omnidrive.scenario.planned_scenario import PlannedScenario, plan_scenario
from omnidrive.scenario.run_settings import fault_of
from omnidrive.scenario.run_simulation import simulate_run
from omnidrive.scenario.variant import robot_in
from omnidrive.simulation import Outcome, Run
from omnidrive.study.computation.batched_runs import batched_records
from omnidrive.study.computation.run_recording import lost_record, record_of, refused_record
from omnidrive.study.design.definition import SeriesKept
from omnidrive.study.design.planned_run import PlannedRun

_KEPT_PLANS, _KEPT_RUNS = 32, 32

Save = Callable[[PlannedRun, Run], None]
"""Receiver of the log of a run."""
_Value = TypeVar("_Value")


def run_block(
    runs: Sequence[PlannedRun],
    save: Save | None = None,
    *,
    series: SeriesKept = "all",
    observers: Sequence[visualization.Observer] = (),
) -> list[RunRecord]:
    """Simulate and evaluate runs; return their records in the same order.

    Results depend neither on the process nor on the other runs of the block. Runs whose plant and
    controller have compiled code are simulated in compiled loops, see :mod:`batched_runs`. A run
    that its scenario does not allow, or whose parts cannot be made, has a record that says so.

    Args:
        runs: The runs.
        save: Receiver of the logs of runs. None: no logs are kept.
        series: Runs whose logs it receives; `failed`: those that ended early.
        observers: Observers of every run; with ``series`` all.

    Raises:
        InvalidInput: ``series`` is not one of its names.
    """
    check_choice("choice of series", series, get_args(SeriesKept))
    kept = series if save is not None else "none"
    records: dict[int, RunRecord] = {}
    if kept != "all":  # logs of compiled loops have no computing times
        records |= batched_records(runs, _plans.planned)
    for index, run in enumerate(runs):
        if index in records:
            continue
        records[index], log = _record(run, observers)
        is_kept = kept == "all" or (kept == "failed" and not records[index].finished)
        if save is not None and log is not None and is_kept:
            save(run, log)
    return [records[index] for index in range(len(runs))]


def _record(
    run: PlannedRun, observers: Sequence[visualization.Observer] = ()
) -> tuple[RunRecord, Run | None]:
    """Return the record and the log of a run; no log of one that cannot be simulated.

    A plant that is lost before a run begins ends the study, which can be continued with it.
    KeyboardInterrupt and the like end the run only in a worker process, where a component raised
    them: it ignores the signals of the terminal.
    """
    if run.refused:
        return refused_record(run, run.refused), None
    try:
        planned = _plans.planned(run)
        log = simulate_run(planned, run.settings, observers)
        return record_of(run, planned, log, _recovery(planned, log, run)), log
    except PlantLost:  # the other runs cannot begin either
        raise
    except OmnidriveError as error:
        return refused_record(run, str(error)), None
    except Exception:
        raise
    except BaseException as error:
        if not is_worker():
            raise
        reason = f"by {type(error).__name__} of a component"
        return lost_record(run, Outcome.KILLED, reason), None


def _recovery(planned: PlannedScenario, log: Run, run: PlannedRun) -> Recovery | None:
    """Return the recovery from a fault, compared with the run without it."""
    if run.settings.task != "faults":
        return None
    fault = fault_of(run.scenario, run.settings)
    if fault is None:
        _undisturbed.put(run.key, log)
        return None
    settings = run.settings._replace(fault=0)
    nominal = _undisturbed.get(run.nominal, lambda: simulate_run(planned, settings))
    return recovery(log, nominal, fault.at)


class LruCache:
    """The latest values by their keys, in this process."""

    def __init__(self, maximum: int) -> None:
        self._max = maximum
        self._values: OrderedDict[Hashable, Any] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], _Value]) -> _Value:
        """Return the value of a key; make it if there is none."""
        if key not in self._values:
            self.put(key, make())
        self._values.move_to_end(key)
        value: _Value = self._values[key]
        return value

    def put(self, key: Hashable, value: object) -> None:
        """Keep a value, and forget the oldest one if there are too many."""
        self._values[key] = value
        if len(self._values) > self._max:
            self._values.popitem(last=False)


class _Plans:
    """Planned scenarios; the motion of runs with equal maps, robots and references is one."""

    def __init__(self) -> None:
        self._motions, self._robots = LruCache(_KEPT_PLANS), LruCache(_KEPT_PLANS)

    def put(self, run: PlannedRun, planned: PlannedScenario) -> None:
        """Keep the planned scenario of a run."""
        self._motions.put(run.plan_keys.motion, planned)
        self._robots.put(run.plan_keys.plant_robot, planned.plant_robot)

    def planned(self, run: PlannedRun) -> PlannedScenario:
        """Return the planned scenario of a run.

        Raises:
            OmnidriveError: See :func:`plan_scenario`.
        """
        scenario, (motion, robot) = run.scenario, run.plan_keys
        planned = self._motions.get(motion, lambda: plan_scenario(scenario))
        true = self._robots.get(robot, lambda: robot_in(plain(scenario.true_robot)))
        return replace(planned, plant_robot=true, scenario=scenario)


_plans, _undisturbed = _Plans(), LruCache(_KEPT_RUNS)


def keep_plan(run: PlannedRun, planned: PlannedScenario) -> None:
    """Use a planned scenario for a run, and for those with the same map, robot and reference."""
    _plans.put(run, planned)
