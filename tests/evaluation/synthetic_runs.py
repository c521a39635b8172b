"""Synthetic tables of runs, with known effects of controllers, axes and seeds."""

from itertools import product

import numpy as np
import pyarrow as pa

TASK = ("noise", 30.0, "")


def synthetic_table(
    effects, *, repetitions=20, axes=None, random=None, tasks=(TASK,), metric="me", seed=1,
    common=1e-3, own=1e-4, failures=None, value=None,
):  # fmt: skip
    """Return a table of runs in the order of a plan: repetition, axis values, task, controller.

    Args:
        effects: Mean of the metric by controller.
        repetitions: Number of repetitions.
        axes: Values of each axis by path.
        random: Values of each random factor by path, one per repetition.
        tasks: Task, duration and variant of each task.
        metric: Name of the metric.
        seed: Seed of the random numbers.
        common: Standard deviation of what a repetition adds to all its runs.
        own: Standard deviation of what every run adds.
        failures: Controllers and repetitions of runs that fail.
        value: Additional effect: function of the controller and the factors.
    """
    rng = np.random.default_rng(seed)
    axes, random, failures = axes or {}, random or {}, failures or set()
    rows, pairing = [], -1
    shift = common * rng.normal(size=repetitions)
    for r in range(repetitions):
        for point in product(*axes.values()):
            factors = dict(zip(axes, point, strict=True))
            factors |= {path: values[r] for path, values in random.items()}
            for task, duration, variant in tasks:
                pairing += 1
                for name, effect in effects.items():
                    failed = (name, r) in failures
                    extra = value(name, factors) if value else 0.0
                    rows.append({
                        "number": len(rows), "key": f"{len(rows):064x}", "pairing": pairing,
                        "controller": name, "task": task, "duration": duration,
                        "variant": variant, "repetition": r, "repeat": 0,
                        "outcome": "controller failed" if failed else "finished",
                        "finished": not failed,
                        **{f"factor:{path}": v for path, v in factors.items()},
                        metric: effect + extra + shift[r] + own * rng.normal(),
                    })  # fmt: skip
    return pa.Table.from_pylist(rows)


def with_repeats(table, repeats):
    """Return a table whose repetitions are the repeats of so few repetitions."""
    number = np.asarray(table["repetition"])
    for name, values in (("repetition", number // repeats), ("repeat", number % repeats)):
        table = table.set_column(table.column_names.index(name), name, pa.array(values))
    return table
