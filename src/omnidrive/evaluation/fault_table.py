"""Table of the recovery of every controller from every fault."""

from __future__ import annotations

from omnidrive.evaluation.recovery import Recovery
from omnidrive.evaluation.results import FaultResult, StudyResults
from omnidrive.evaluation.table import Table, number_text
from omnidrive.simulation import Outcome
from omnidrive.simulation.disturbances import FAULTS


def fault_table(results: StudyResults) -> Table:
    """Return a table of recovery, maximum error and recovery time by fault and controller."""
    rows = [
        (f"{r.number} {_fault_text(r)}", r.controller, _verdict(r, recovery),
         number_text(1e3 * recovery.max_error), number_text(recovery.time_to_recover),
         number_text(1e3 * r.metrics.me), _first_detection(r))
        for r, recovery in results.recoveries
    ]  # fmt: skip
    return Table(
        "Disturbances and faults",
        ("fault", "controller", "recovered", "max. error, mm", "time to recover, s", "ME, mm",
         "first detection"),
        tuple(rows),
        "Stopped: by the watchdog." if any(row[2].startswith("stopped") for row in rows) else "",
        definitions=(
            (
                "recovered",
                "Recovered: from some time until the end, the position error exceeds that of the "
                "same controller without the fault by at most 0.05 m.",
            ),
            (
                "time to recover, s",
                "Time to recover: from the start of the fault; 0: this limit was never exceeded.",
            ),
            (
                "first detection",
                "First detection: the first event that the watchdog or the wheel monitor reported.",
            ),
        ),
        keys=2,
        prose=True,
    ).mark_best(("max. error, mm", "time to recover, s", "ME, mm"), group=0)  # fmt: skip


def _fault_text(result: FaultResult) -> str:
    """Return the kind of the fault, its start and its wheel, if any."""
    fault = result.fault
    assert fault is not None
    wheel = getattr(fault, "wheel", None)
    return f"{fault.kind} at {fault.at:g} s" + ("" if wheel is None else f", wheel {wheel}")


def _verdict(result: FaultResult, recovery: Recovery) -> str:
    if recovery.recovered:
        return "yes"
    if result.run.outcome is Outcome.FINISHED:
        return "no"
    verdict = "stopped" if recovery.stopped else "failed"
    return f"{verdict} at {result.run.t[-1]:g} s"


def _first_detection(result: FaultResult) -> str:
    """Return the first event that the supervision reported, with its time."""
    scheduled = {f"{kind} {change}" for kind in FAULTS for change in ("begins", "ends")}
    detected = [event for event in result.run.events if event.what not in scheduled]
    return f"{detected[0].t:.2f} s: {detected[0].what}" if detected else ""
