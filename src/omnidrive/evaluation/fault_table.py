"""The table of what controllers make of faults."""

from __future__ import annotations

from math import isfinite

from omnidrive.evaluation.recovery import Recovery
from omnidrive.evaluation.results import FaultResult, StudyResults
from omnidrive.evaluation.table import Table
from omnidrive.simulation import Outcome
from omnidrive.simulation.faults import FAULTS


def fault_table(results: StudyResults) -> Table:
    """Every fault and controller: whether, how far and how soon the robot came back."""
    rows = [
        (f"{r.number} {_what(r)}", r.controller, _verdict(r, found), f"{found.max_error:.3f}",
         f"{found.time_to_recover:.1f}" if isfinite(found.time_to_recover) else "–",
         f"{r.metrics.me:.4f}", _found(r))
        for r, found in results.recoveries
    ]  # fmt: skip
    return Table(
        "Disturbances and faults",
        ("fault", "controller", "recovered", "worst error, m", "time to recover, s", "ME, m",
         "what was found, and when"),
        tuple(rows),
        "Recovered: from some time to the end the robot errs at most 0.05 m more than the same "
        "controller does at that time without the fault. Time to recover: from the beginning of "
        "the fault; 0: it was never further away. Stopped: by the watchdog.",
        keys=2,
        prose=True,
    )  # fmt: skip


def _what(result: FaultResult) -> str:
    """The fault, when, and which wheel."""
    fault = result.fault
    assert fault is not None
    wheel = getattr(fault, "wheel", None)
    return f"{fault.kind} at {fault.at:g} s" + ("" if wheel is None else f", wheel {wheel}")


def _verdict(result: FaultResult, found: Recovery) -> str:
    if found.recovered:
        return "yes"
    if result.run.outcome is Outcome.FINISHED:
        return "no"
    word = "stopped" if found.stopped else "failed"
    return f"{word} at {result.run.t[-1]:g} s"


def _found(result: FaultResult) -> str:
    """The first thing that the robot itself found out."""
    known = {f"{kind} {does}" for kind in FAULTS for does in ("begins", "ends")}
    found = [event for event in result.run.events if event.what not in known]
    return f"{found[0].t:.2f} s: {found[0].what}" if found else ""
