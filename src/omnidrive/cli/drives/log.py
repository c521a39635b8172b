"""Command `omnidrive log`: logs of drives."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omnidrive.cli.drives.drive_errors import drive_errors, tracking_error
from omnidrive.cli.drives.log_replay import compare, replay
from omnidrive.cli.options import RESULTS_PANEL, ForceOption, JsonOption, option, verb_group
from omnidrive.cli.terminal import conclude, note, print_json
from omnidrive.cli.terminal import show as print_line
from omnidrive.errors import InvalidInput, one_line

if TYPE_CHECKING:
    from omnidrive.deploy.log import LoggedDrive
    from omnidrive.simulation import Run

log = verb_group("Show, export, replay and compare logs of drives.")

LogArgument = Annotated[
    Path,
    typer.Argument(
        metavar="FILE.mcap|FOLDER",
        help="Log of a drive, or the first of its files, or the folder of one drive.",
    ),
]
_TABLES = (".csv", ".parquet")
_MAX_EVENTS = 20


@log.command()
def show(
    file: LogArgument,
    png: Annotated[
        Path | None,
        option("FILE.png", "Draw path and errors; .svg is supported too.", RESULTS_PANEL),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Show what the log of a drive holds: states with their reasons, errors and punctuality.

    A log that ends early, because the process was killed or the disk was full, is shown up to its
    end.

    For example:

    * `omnidrive log show runs/monday`
    * `omnidrive log show log.mcap --png drive.png`
    """
    from omnidrive.deploy.log import read_log
    from omnidrive.study.output_paths import check_figure

    if png is not None:
        check_figure(png)
    found = read_log(file)
    run = found.run() if found.has_steps else None
    if json:
        print_json(_record(found, run))
    else:
        for line in _lines(found, run):
            print_line(line)
    if png is not None:
        if run is None:
            raise InvalidInput(f"{one_line(str(file))}: the controller did not drive, draw nothing")
        from omnidrive.evaluation.figures import run_figure, save

        save(run_figure(run), png)
        conclude(f"figure written to {png}", beside_json=json)


@log.command()
def export(
    file: LogArgument,
    out: Annotated[Path, option("FILE", "Table to write: .csv or .parquet.")],
    force: ForceOption = False,
) -> None:
    """Write the samples in which the controller drove as a table, with the columns of a run folder.

    The true pose is the estimated one. Parquet files keep the unit of each column.

    For example:

    * `omnidrive log export log.mcap --out drive.csv`
    """
    from omnidrive.deploy.log import read_log
    from omnidrive.study.output_paths import check_new_file

    if out.suffix.lower() not in _TABLES:
        raise InvalidInput(
            f"{one_line(str(out))}: the suffix of a table is one of {', '.join(_TABLES)}"
        )
    check_new_file(out, force=force)
    found = read_log(file)
    run = found.run()
    run.save(out)
    if not found.complete:
        note(f"{file} ends before the drive")
    conclude(f"{len(run.t)} samples written to {out}")


for _verb in (replay, compare):
    log.command()(_verb)


def _record(found: LoggedDrive, run: Run | None) -> dict[str, Any]:
    """Return what a log holds, for JSON."""
    timing = found.timing().summary()
    data: dict[str, Any] = {
        "files": [str(path) for path in found.paths],
        "drive": {
            key: value for key, value in found.metadata.items() if key not in {"part", "drive"}
        },
        "robot": found.robot.name,
        "attached": sorted(found.files),
        "complete": found.complete,
        "samples": found.sample_count,
        "dropped": found.dropped,
        "sample_time_s": found.dt,
        "timing": timing._asdict() | {"miss_share": timing.miss_share},
        "states": [
            {"t": each.t, "state": each.state.value, "reason": each.reason}
            for each in found.changes
        ],
        "events": [each._asdict() for each in found.events],
        "segments": len(found.segments),
    }
    return data | ({} if run is None else {"duration_s": float(run.t[-1]), **drive_errors(run)})


def _lines(found: LoggedDrive, run: Run | None) -> list[str]:
    """Return what a log holds, as lines of text."""
    about = found.metadata
    facts = {
        "robot": found.robot.name,
        "link": about.get("link", ""),
        "controller": about.get("controller", ""),
        "estimator": about.get("estimator", ""),
        "begun": _begun(about.get("drive", "")),
        "samples": f"{found.sample_count} at {1.0 / found.dt:g} Hz",
        "attached": ", ".join(sorted(found.files)),
        "measures": about.get("measures", ""),
    }
    lines = [f"{name:<20}{one_line(fact, 200)}" for name, fact in facts.items() if fact]
    if found.dropped:
        lines.append(f"{'dropped':<20}{found.dropped} samples, which could not be written in time")
    if not found.complete:
        lines.append(f"{'end':<20}missing: the process was killed, or the disk was full")
    lines += ["", *(f"{c.t:8.3f} s  {c.state.value:<8} {c.reason}" for c in found.changes)]
    lines += [f"{each.t:8.3f} s  {each.what}" for each in found.events[:_MAX_EVENTS]]
    more = len(found.events) - _MAX_EVENTS
    lines += [f"and {more} more events: --json lists them", ""] if more > 0 else [""]
    if run is not None:
        lines.append(tracking_error(run))
    return [*lines, *_timing(found)]


def _timing(found: LoggedDrive) -> list[str]:
    timing = found.timing()
    figures = timing.summary()
    return [
        f"missed {figures.misses} deadlines ({100.0 * figures.miss_share:.2g} %), jitter "
        f"{1e6 * figures.jitter_median:.0f} us (median), {1e6 * figures.jitter_p99:.0f} us (p99), "
        f"{1e6 * figures.jitter_max:.0f} us (largest)",
        f"until the command is sent {1e3 * figures.busy_median:.2f} ms (median), "
        f"{1e3 * figures.busy_p99:.2f} ms (p99)",
        timing.histogram(),
    ]


def _begun(nanoseconds: str) -> str:
    """Return the time of the begin; empty if it is not usable."""
    try:
        begun = datetime.fromtimestamp(int(nanoseconds) // 10**9, UTC)
    except (ValueError, OverflowError, OSError):
        return ""
    return f"{begun:%Y-%m-%d %H:%M:%S} UTC"
