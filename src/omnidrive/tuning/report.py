"""Results of tuning as files: parameters, trials, figures and an HTML report."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from hashlib import sha256
from html import escape
from io import StringIO
from math import isfinite
from pathlib import Path
from shlex import quote

from matplotlib.figure import Figure

from omnidrive.evaluation.figures.style import save
from omnidrive.evaluation.page.document import document, fill_template, read_parts
from omnidrive.evaluation.page.markup import (
    PageFigure,
    figure_markup,
    items_markup,
    tables_markup,
)
from omnidrive.evaluation.tables.table import NO_VALUE, Table
from omnidrive.files.output_file import create_folder, output_file
from omnidrive.scenario.controller_file import save_controller
from omnidrive.study import StudyDefinition
from omnidrive.tuning.figures import front_figure, progress_figure
from omnidrive.tuning.gain import Gain, HeldOut
from omnidrive.tuning.optimizers import front
from omnidrive.tuning.problem import HELD_OUT_FILE, SETTINGS_FILE, TRAINING_FILE
from omnidrive.tuning.tune import TuningResult

PARAMETERS_FILE = "parameters.yaml"
"""Name of the file with the tuned controller."""


def lead(result: TuningResult) -> str:
    """Return the result as one or two sentences."""
    label = result.tuning.settings.controller
    if result.chosen.number == 0:
        return (
            f"No trial shows a gain over the values of {label} before tuning on other motions than "
            "those of training, and on none of them a loss; these values are kept "
            f"({len(result.search.trials)} trials)."
        )
    if not result.held_out.gains:
        return f"{label} is tuned, but no held-out run finished before and after tuning."
    gain = result.held_out.gains[0]
    sentences = [f"{label} on runs that the search has not seen: {gain.text}: {gain.verdict}."]
    if result.chosen.score.violation > 0.0:
        sentences.append("No trial keeps all limits.")
    held_out = result.held_out
    if held_out.failed_after or held_out.failed_before:
        sentences.append(
            f"{held_out.failed_after} of {held_out.runs} held-out runs ended early, before tuning "
            f"{held_out.failed_before}; gains are those of the others."
        )
    return " ".join([*sentences, *_harm(held_out)])


_NAMED = 6  # worse quantities in a sentence

_WORSE = "\u2717 worse"
"""Result of a quantity that is worse after tuning, also readable without colour."""


def _harm(held_out: HeldOut) -> list[str]:
    """Return the sentence on what is worse after tuning; none: nothing is."""
    worse = sorted(held_out.worse, key=lambda each: (each[0] != "", -abs(each[1].relative[0])))
    if not worse:
        return []
    names = [f"{each.label} ({each.change})" + f" in {at}" * bool(at) for at, each in worse]
    rest = len(names) - _NAMED
    more = f"; and {rest} more, see the table of motions" if rest > 0 else ""
    return [f"Worse after tuning: {'; '.join(names[:_NAMED])}{more}."]


def tuning_tables(result: TuningResult) -> list[Table]:
    """Return the gains on the held-out set, the changed parameters and, of several, the front.

    The gains on every motion are left out where the values before tuning are kept.
    """
    tables = [_gain_table(result)]
    if result.chosen.number:
        tables.append(_motion_table(result))
    tables.append(_change_table(result))
    if len(result.tuning.objectives) > 1:
        tables.append(_front_table(result))
    return tables


def write_tuning(result: TuningResult) -> Iterator[Path]:
    """Write ``parameters.yaml``, ``trials.csv``, figures and ``report.html`` into the folder.

    Of several objectives, ``front/`` holds the controller of each point of the front.

    Yields:
        Path of each file after it is written.

    Raises:
        CannotWrite: A file cannot be written.
    """
    folder, space = result.folder, result.tuning.space
    comments = [
        f"Tuned by omnidrive tune: {' and '.join(map(str, result.tuning.objectives))}",
        *(each.text for each in result.held_out.gains[:1]),
    ]
    save_controller(result.after, folder / PARAMETERS_FILE, comments)
    yield folder / PARAMETERS_FILE
    if len(result.tuning.objectives) > 1:
        create_folder(folder / "front")
        for k, number in enumerate(_front(result), 1):
            controller = space.controller_with(result.search.trials[number].values)
            assert controller is not None
            path = folder / "front" / f"{k:02d}.yaml"
            save_controller(controller, path, [f"Point {k} of the front, trial {number}"])
            yield path
    with output_file(folder / "trials.csv") as part:
        part.write_text(_trials_csv(result), encoding="utf-8")
    yield folder / "trials.csv"
    figures = []
    create_folder(folder / "figures")
    for each in _figures(result):
        path = folder / "figures" / f"{each[0]}.svg"
        save(each[3], path)
        figures.append(PageFigure(each[1], each[2], path.read_bytes()))
        yield path
    with output_file(folder / "report.html") as part:
        part.write_text(_page(result, figures), encoding="utf-8", errors="backslashreplace")
    yield folder / "report.html"


def _front(result: TuningResult) -> list[int]:
    return front([each.score for each in result.search.trials])


def _gain_table(result: TuningResult) -> Table:
    return Table(
        "Gain on the held-out runs",
        ("Quantity", *_COLUMNS),
        tuple((each.label, *_cells(each)) for each in result.held_out.gains),
        lead=lead(result),
    )


def _motion_table(result: TuningResult) -> Table:
    return Table(
        "Every held-out motion",
        ("Motion", "Quantity", *_COLUMNS),
        tuple(
            (motion, each.label, *_cells(each))
            for motion, gains in result.held_out.motions
            for each in gains
        ),
        keys=2,
        is_detail=True,
        note="Intervals are over the repetitions of the motion, each at 95 %: of 40 quantities "
        "without a change, one is marked as worse by chance.",
    )


_COLUMNS = ("Before", "Tuned", "Change, %", "95 % interval, %", "Result")


def _cells(gain: Gain) -> tuple[str, ...]:
    """Return the cells of a gain, see _COLUMNS."""
    mean, low, high = (100.0 * share for share in gain.relative)
    change = f"{mean:+z.1f}" if isfinite(mean) else NO_VALUE
    interval = f"[{low:+z.1f}, {high:+z.1f}]" if isfinite(low) else NO_VALUE
    cells = (f"{gain.before:.4g}", f"{gain.after:.4g}", change, interval)
    shown = tuple(cell.replace("-", "\u2212") for cell in cells)
    return *shown, _WORSE if gain.is_worse else gain.verdict


def _change_table(result: TuningResult) -> Table:
    base, tuned = result.tuning.space.base, result.chosen.values
    changed = [
        each for each in result.tuning.space.dimensions if tuned[each.name] != base[each.name]
    ]
    same = len(base) - len(changed)
    return Table(
        "Changed parameters",
        ("Parameter", "Before", "Tuned", "Unit", "Range"),
        tuple(
            (
                each.name,
                f"{base[each.name]:.4g}",
                f"{tuned[each.name]:.4g}",
                "" if each.unit == "1" else each.unit,
                f"{each.low:.4g} to {each.high:.4g}",
            )
            for each in changed
        ),
        note=f"{same} tuned parameters have the values before tuning." if same else "",
    )


def _front_table(result: TuningResult) -> Table:
    objectives = result.tuning.objectives
    rows = [
        (
            f"{k:02d}.yaml",
            str(number),
            *(f"{value:.4g}" for value in result.search.trials[number].score.objectives),
        )
        for k, number in enumerate(_front(result), 1)
    ]
    return Table(
        "Front",
        ("File in front/", "Trial", *map(str, objectives)),
        tuple(rows),
        note=f"Values on the training runs. {PARAMETERS_FILE} is the compromise, trial "
        f"{result.chosen.number}.",
    )


def _trials_csv(result: TuningResult) -> str:
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [each.name for each in result.tuning.space.dimensions]
    objectives = [each.text for each in result.tuning.objectives]
    writer.writerow(["trial", *objectives, "violation", "failed_runs", *names])
    for each in result.search.trials:
        score = each.score
        values = [each.values[name] for name in names]
        writer.writerow([each.number, *score.objectives, score.violation, each.failed, *values])
    return text.getvalue()


def _figures(result: TuningResult) -> Iterator[tuple[str, str, str, Figure]]:
    """Yield name, title, caption and figure."""
    objectives, trials = result.tuning.objectives, result.search.trials
    yield (
        "trials", "Objective over the trials",
        "Every point is one trial on the training runs; trials that violate a limit are left out.",
        progress_figure(objectives, trials),
    )  # fmt: skip
    if len(objectives) > 1:
        yield (
            "front", "Front of the objectives",
            "No trial is better than a point of the front in all objectives.",
            front_figure(objectives, trials, result.chosen.number),
        )  # fmt: skip


def _page(result: TuningResult, figures: Sequence[PageFigure]) -> str:
    """Return the HTML report; its content security policy permits only its own scripts."""
    settings, folder = result.tuning.settings, result.folder
    name = quote(str(folder))
    file = quote(str(folder / PARAMETERS_FILE))
    code = " --allow-code" if result.tuning.sets.training.names_code else ""
    hashes = {
        each: sha256((folder / each).read_bytes()).hexdigest()
        for each in (SETTINGS_FILE, TRAINING_FILE, HELD_OUT_FILE, PARAMETERS_FILE, "trials.csv")
    }
    parts = {
        "kind": "tuning",
        "question": "",
        "title": escape(f"{settings.controller}: {', '.join(settings.objectives)}"),
        "facts": items_markup(_facts(result)),
        "lead": escape(lead(result)),
        "tables": tables_markup(tuning_tables(result)),
        "figures": "\n".join(map(figure_markup, figures)),
        "setup": fill_template("setup.html", {"setup": items_markup(_setup(result))}),
        "use": escape(f"omnidrive compare --controller {file}{code}"),
        "command": escape(f"omnidrive tune {name}{code}"),
        "hashes": items_markup(hashes),
        "parameters": escape((folder / PARAMETERS_FILE).read_text(encoding="utf-8")),
    }
    styles, scripts = read_parts(("page.css",)), read_parts(("theme_button.js",))
    return document("tuning.html", parts, styles, scripts)


def _facts(result: TuningResult) -> dict[str, str]:
    settings = result.tuning.settings
    return {
        "Controller": f"{settings.controller} ({result.after.type})",
        "Parameters": str(len(result.tuning.space.dimensions)),
        "Trials": f"{len(result.search.trials):,}",
        "Held-out runs": f"{result.held_out.runs:,}",
    }


def _setup(result: TuningResult) -> dict[str, str]:
    settings, sets = result.tuning.settings, result.tuning.sets
    scenario = sets.training.scenario
    return {
        "Objective": " and ".join(map(str, result.tuning.objectives)),
        "Limits": ", ".join(settings.limits) or "every training run must finish",
        "Optimiser": ("CMA-ES" if len(settings.objectives) == 1 else "NSGA-II")
        + f", seed {settings.seed}",
        "Robot and plant": f"{scenario.robot.name}, {scenario.plant.type}",
        "Training": _set_text(sets.training),
        "Held out": _set_text(sets.held_out),
    }


def _set_text(definition: StudyDefinition) -> str:
    """Return seed, repetitions, axes and random factors of a set of runs."""
    parts = [f"seed {definition.scenario.seed}", f"{definition.repetitions} repetitions"]
    for axis in definition.axes:
        parts.append(f"{axis.name}: {', '.join(map(str, axis.labels))}")
    parts += [f"{each.name} {each.distribution}" for each in definition.random.factors]
    return "; ".join(parts)
