"""Runs of a study as columns: what evidence, figures and reports are computed from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, suggestion
from omnidrive.evaluation.measures.quantities import quantity
from omnidrive.evaluation.measures.step_response import STEP_AXES
from omnidrive.evaluation.run_record import RunRecord

FACTOR_PREFIX = "factor:"
"""Prefix of the columns with the values of axes and random factors, before their path."""

MAX_LEVELS = 50
"""Number of values of an axis up to which each is shown."""

_SETTLING = tuple(f"settling_time_{axis}" for axis in STEP_AXES)

IDENTITY = (
    "number", "key", "pairing", "controller", "task", "duration", "variant", "repetition",
    "repeat", "outcome", "finished",
)  # fmt: skip
"""Columns of every table of runs; factors and metrics follow."""


_VARIED = {"faults": "fault", "horizon": "horizon"}
"""Axis that the variants of a task are values of."""


REFUSED = "refused"
"""Outcome of a planned run whose values are not possible together, such as a mass below 0."""


class Task(NamedTuple):
    """What a run does, apart from controller, factors and repetition."""

    name: str
    """Task of the scenario, such as ``track``."""
    duration: float
    """Duration of the reference, s."""

    @property
    def label(self) -> str:
        """Name with the duration; it is fixed for a step response."""
        return "step response" if self.name == "step" else f"{self.name} {self.duration:g} s"


class RunTable:
    """Finished and failed runs of a study, one row each, in the order of their numbers.

    Attributes:
        table: The rows; columns :data:`IDENTITY`, ``factor:PATH`` and metrics.
        refused: Number of planned runs whose values are not possible together; they are no rows.
        controllers: Labels of the controllers in their order.
        tasks: Tasks in their order.
        controller: Index of the controller of each row.
        task: Index of the task of each row.
    """

    def __init__(self, table: pa.Table, timing: pa.Table | None = None) -> None:
        """Read the columns of a table.

        Args:
            table: The runs, as :meth:`Store.records` returns them.
            timing: Computing times of the runs, by ``number``; None: unknown.

        Raises:
            InvalidInput: A column is missing.
        """
        missing = [name for name in IDENTITY if name not in table.column_names]
        if missing:
            raise InvalidInput(f"not a table of runs: it has no column {', '.join(missing)}")
        possible = pc.not_equal(table["outcome"], REFUSED)
        self.table, self._timing = table.filter(possible), timing
        self.refused = int(table.num_rows - self.table.num_rows)
        table = self.table
        self.controllers, self.controller = _coded(table["controller"])
        names, name_codes = _coded(table["task"])
        duration = _floats(table["duration"])
        rows = list(zip(name_codes.tolist(), duration.tolist(), strict=True))
        order = {key: k for k, key in enumerate(dict.fromkeys(rows))}
        self.tasks = tuple(Task(names[n], d) for n, d in order)
        self.task = np.array([order[key] for key in rows], dtype=np.int64)

    def __len__(self) -> int:
        """Return the number of runs."""
        return int(self.table.num_rows)

    @cached_property
    def repetition(self) -> Int[Array, " runs"]:
        """Repetition of each row."""
        return self._integers("repetition")

    @cached_property
    def unit(self) -> Int[Array, " runs"]:
        """Index of the independent observation that each row belongs to.

        It is the repetition, and the repeat in it where the task repeats its runs. The repeats of
        one repetition share the sample of random factors: with these, it is the repetition alone.
        """
        repeat = 0 if self.random_factors else self._integers("repeat")
        unit: Int[Array, " runs"] = self.repetition * self.repeats + repeat
        return unit

    @cached_property
    def pairing(self) -> Int[Array, " runs"]:
        """Index of everything except the controller of each row."""
        return self._integers("pairing")

    @cached_property
    def finished(self) -> Bool[Array, " runs"]:
        """Whether each run reached the end of its reference."""
        column: Bool[Array, " runs"] = np.asarray(self.table["finished"].to_numpy(), dtype=bool)
        return column

    @cached_property
    def repetitions(self) -> int:
        """Number of different repetitions."""
        return len(np.unique(self.repetition))

    @cached_property
    def repeats(self) -> int:
        """Number of runs in the tasks that repeat their runs with other noise; at least 1."""
        return int(self._integers("repeat").max(initial=0)) + 1

    @cached_property
    def metrics(self) -> tuple[str, ...]:
        """Metrics that have a value in some row; then computing times, then derived metrics."""
        names = [
            name
            for name in self.table.column_names
            if name not in IDENTITY and not name.startswith(FACTOR_PREFIX)
        ]
        if self._timing is not None:
            names += [name for name in self._timing.column_names if name != "number"]
        if set(_SETTLING) <= set(names):
            names.append("settling_time")
        return tuple(name for name in names if np.isfinite(self.values(name)).any())

    @cached_property
    def factors(self) -> dict[str, Array]:
        """Values of every factor that varies, by its path: numbers, or texts as objects.

        The faults of the task `faults` and the horizons of the task `horizon` are values of the
        axes ``fault`` and ``horizon``, which are empty texts in other tasks.
        """
        found: dict[str, Array] = {}
        for name in self.table.column_names:
            if name.startswith(FACTOR_PREFIX):
                column = self.table[name]
                values = (
                    _floats(column) if _is_number(column.type)
                    else np.array([str(v) for v in column.to_pylist()], dtype=object)
                )  # fmt: skip
                found[name.removeprefix(FACTOR_PREFIX)] = values
        varied = [(k, task) for k, task in enumerate(self.tasks) if task.name in _VARIED]
        if varied:
            variant = np.array(self.table["variant"].to_pylist(), dtype=object)
            for k, task in varied:
                path = _VARIED[task.name]
                found[path] = np.where(self.task == k, variant, found.get(path, ""))
        return {path: each for path, each in found.items() if (each != each[:1]).any()}

    @cached_property
    def random_factors(self) -> tuple[str, ...]:
        """Paths of the factors that have one value per repetition, if there are several."""
        if self.repetitions < 2:
            return ()
        return tuple(path for path in self.factors if self._follows_repetition(path))

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """Paths of the factors whose values are combined with every repetition."""
        return tuple(path for path in self.factors if path not in self.random_factors)

    @cached_property
    def shown_axes(self) -> tuple[str, ...]:
        """Axes with few values, of which tables and curves show every one."""
        return tuple(path for path in self.axes if len(self.levels(path)[0]) <= MAX_LEVELS)

    def levels(self, path: str) -> tuple[list[Any], Int[Array, " runs"]]:
        """Return the different values of a factor in increasing order, and the index of each row.

        Texts keep the order of the rows.

        Raises:
            InvalidInput: No factor that varies has this path.
        """
        if path not in self.factors:
            raise InvalidInput(f"no factor {path!r} varies{suggestion(path, self.factors)}")
        values = self.factors[path]
        if values.dtype == object:
            order = {value: k for k, value in enumerate(dict.fromkeys(values.tolist()))}
            return list(order), np.array([order[v] for v in values.tolist()], dtype=np.int64)
        levels, codes = np.unique(values, return_inverse=True)
        return levels.tolist(), codes.astype(np.int64)

    def values(self, metric: str) -> Float[Array, " runs"]:
        """Return a metric of each row in its stored unit; NaN where the run has no valid value.

        A run that ended early has no valid value, unless the metric needs no finished run. The
        metric ``finished`` is 1 or 0; ``settling_time`` is that of the slowest axis with a step.

        Raises:
            InvalidInput: The table has no such metric.
        """
        if metric == "settling_time" and metric not in self.table.column_names:
            return self._slowest_settling()
        if metric != "finished" and (metric in IDENTITY or metric not in self.table.column_names):
            return self._times(metric)
        values = _floats(self.table[metric])
        return np.where(self.finished, values, np.nan) if quantity(metric).needs_finish else values

    def _slowest_settling(self) -> Float[Array, " runs"]:
        """Return the settling time of the slowest axis with a step; NaN if one does not settle."""
        times = np.column_stack([self.values(name) for name in _SETTLING])
        steps = np.column_stack([self.values(f"overshoot_{axis}") for axis in STEP_AXES])
        times = np.where(np.isfinite(steps), times, -np.inf)
        slowest: Float[Array, " runs"] = times.max(axis=1)
        return np.where(np.isfinite(slowest), slowest, np.nan)

    def _times(self, metric: str) -> Float[Array, " runs"]:
        """Return a computing time of each row; NaN where it is unknown."""
        timing = self._timing
        if timing is None or metric not in timing.column_names or metric == "number":
            known = [n for n in self.table.column_names if n not in IDENTITY and ":" not in n]
            raise InvalidInput(f"the runs have no metric {metric!r}{suggestion(metric, known)}")
        numbers = np.asarray(timing["number"].to_numpy(), dtype=np.int64)
        if not len(numbers):
            return np.full(len(self), np.nan)
        order, wanted = np.argsort(numbers, kind="stable"), self._integers("number")
        place = np.minimum(np.searchsorted(numbers, wanted, sorter=order), len(numbers) - 1)
        rows = order[place]
        return np.where(numbers[rows] == wanted, _floats(timing[metric])[rows], np.nan)

    def _integers(self, name: str) -> Int[Array, " runs"]:
        column: Int[Array, " runs"] = np.asarray(self.table[name].to_numpy(), dtype=np.int64)
        return column

    def _follows_repetition(self, path: str) -> bool:
        """Return whether every repetition has one value of a factor."""
        _, codes = self.levels(path)
        _, index = np.unique(self.repetition, return_inverse=True)
        low = np.full(self.repetitions, np.iinfo(np.int64).max)
        high = np.full(self.repetitions, -1)
        np.minimum.at(low, index, codes)
        np.maximum.at(high, index, codes)
        return bool((low == high).all())


def tables_of(records: Sequence[RunRecord]) -> tuple[pa.Table, pa.Table]:
    """Return runs, and their computing times by ``number``, as the tables of :class:`RunTable`."""
    rows = [
        {name: getattr(each, name) for name in IDENTITY}
        | {f"{FACTOR_PREFIX}{path}": value for path, value in each.factors.items()}
        | each.metrics
        for each in records
    ]
    times = [{"number": each.number, **each.timing} for each in records]
    return _table_of(rows), _table_of(times)


def _table_of(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return a table of rows with different names; null where a row has no value."""
    names = dict.fromkeys(name for row in rows for name in row)
    return pa.table({name: [row.get(name) for row in rows] for name in names})


def _coded(column: Any) -> tuple[tuple[str, ...], Int[Array, " runs"]]:
    """Return the different texts of a column in the order of their first rows, and the codes."""
    array = column.combine_chunks()
    encoded = array if pa.types.is_dictionary(array.type) else array.dictionary_encode()
    texts = ["" if text is None else str(text) for text in encoded.dictionary.to_pylist()]
    codes = np.asarray(encoded.indices.to_numpy(), dtype=np.int64)
    used, first, inverse = np.unique(codes, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    order = np.argsort(first)
    return tuple(texts[used[k]] for k in order), rank[inverse].astype(np.int64)


def _is_number(kind: Any) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _floats(column: Any) -> Float[Array, " runs"]:
    """Return a column of numbers or truth values as floats; NaN for null."""
    values: Float[Array, " runs"] = np.asarray(
        column.cast(pa.float64()).to_numpy(), dtype=np.float64
    )
    return values
