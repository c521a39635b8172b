"""Inference: from input values to output values, for single evaluations and batches."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, cast, get_args, overload

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.choices import ALGORITHMS, Algorithm, Centroid, NoRule, OutOfRange, Reduction
from omnidrive.compiled import entry_point
from omnidrive.errors import InvalidInput, suggestion
from omnidrive.fuzzy.compilation import MAX_SAMPLES, MAX_SLICES, InferenceOptions, compile_system
from omnidrive.fuzzy.kernels import (
    NO_RULE,
    NOT_FINITE,
    infer_one,
    infer_rows,
    rule_strengths,
)
from omnidrive.fuzzy.rules import Rule
from omnidrive.fuzzy.segments import reason_not_exact
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.parameter import check_choice


class FiredRule(NamedTuple):
    """A rule with a positive firing strength."""

    number: int
    """Number of the rule in the system, from 1."""
    rule: Rule
    lower: float
    """Lower firing strength, 0 to 1."""
    upper: float
    """Upper firing strength; equal to the lower one in a type-1 system."""


class Inference:
    """A compiled fuzzy system.

    Callable with one number per input, with an array whose last axis is the inputs, or with a
    mapping from input names to values; the outputs have the same form.

    The value of a type-2 system is the midpoint of its type-reduced interval, and :meth:`interval`
    returns the interval. The value of a type-3 system is the mean over its z-slices, weighted by
    their levels.

    Args:
        system: The fuzzy system.
        centroid: ``exact``: closed form for aggregated outputs that are polylines; ``matlab``:
            sums over samples of the outputs' ranges, as Matlab does. None: exact if possible.
        samples: Number of these samples.
        reduction: Type reduction of a type-2 system: ``centroid`` of the aggregated output, as
            Matlab does, or ``cos``, centre of sets.
        algorithm: Algorithm of type reduction; None: that of the system.
        out_of_range: Policy for an input beyond its range: ``clamp`` to the range, ``matlab`` (no
            change, so that often no rule fires), or ``raise``.
        no_rule: Policy for an output for which no rule fires: its ``default`` (the middle of its
            range if it has none), or ``raise``.
        slices: Number of levels of the z-slices of a type-3 system.

    Raises:
        InvalidInput: An option is unknown or does not apply to the system.
    """

    def __init__(
        self,
        system: FuzzySystem,
        *,
        centroid: Centroid | None = None,
        samples: int = 101,
        reduction: Reduction = "centroid",
        algorithm: Algorithm | None = None,
        out_of_range: OutOfRange = "clamp",
        no_rule: NoRule = "default",
        slices: int = 10,
    ) -> None:
        if centroid is None:
            centroid = "matlab" if not system.is_sugeno and reason_not_exact(system) else "exact"
        options = InferenceOptions(
            centroid, samples, reduction, algorithm or system.algorithm, out_of_range, no_rule,
            slices,
        )  # fmt: skip
        _check(options)
        self.system = system
        self.options = options
        self._inputs = tuple(variable.name for variable in system.inputs)
        self._outputs = tuple(variable.name for variable in system.outputs)
        self._floats, self._integers, self._slices = compile_system(system, options)
        self._is_sliced = len(self._slices) > 1
        self._count = len(self._inputs)
        self._blank = np.empty(len(self._outputs))

    @property
    def arrays(self) -> tuple[Array, Array, Array]:
        """Floats, integers and slices of the system, for :func:`.kernels.infer_rows`."""
        return self._floats, self._integers, self._slices

    def _repr_html_(self) -> str:
        """Return the fuzzy system for notebooks."""
        return self.system._repr_html_()

    @overload
    def __call__(self, inputs: Mapping[str, float], /) -> dict[str, float]: ...
    @overload
    def __call__(self, *inputs: float) -> Float[Array, " outputs"]: ...
    @overload
    def __call__(
        self, inputs: Float[Array, "*rows inputs"], /
    ) -> Float[Array, "*rows outputs"]: ...
    def __call__(self, *inputs: float | Mapping[str, float] | Array) -> Array | dict[str, float]:
        """Return the value of every output.

        Raises:
            InvalidInput: An input is missing or not finite, or a policy is ``raise`` and an input
                is out of range or no rule fires.
        """
        if len(inputs) == 1 and not isinstance(inputs[0], float | int):
            return self._call_with_collection(inputs[0])
        if self._is_sliced or len(inputs) != self._count:
            first: Array = self._all(cast("tuple[float, ...]", inputs))[0]
            return first
        values = self._blank.copy()
        status = self._infer_one(self._floats, self._integers, inputs, values)
        if status:
            raise self._error(status, cast("tuple[float, ...]", inputs))
        return values

    def __getstate__(self) -> dict[str, object]:
        # the entry point is an address, valid only in its process
        return {k: v for k, v in vars(self).items() if k != "_infer_one"}

    def interval(self, *inputs: float) -> tuple[Float[Array, " outputs"], Float[Array, " outputs"]]:
        """Return least and greatest value of every output, for one number per input.

        Raises:
            InvalidInput: As for a call.
        """
        _, minimum, greatest = self._all(inputs)
        return minimum, greatest

    def batch(
        self, rows: Float[Array, "rows inputs"], *, threads: int = 1
    ) -> Float[Array, "3 rows outputs"]:
        """Return value, least and greatest of every output for each row of inputs.

        Args:
            rows: One row per evaluation.
            threads: Number of threads.

        Raises:
            InvalidInput: As for a call; the message contains the row.
        """
        rows = np.ascontiguousarray(rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(self._inputs):
            raise InvalidInput(
                f"needs rows of {len(self._inputs)} inputs ({', '.join(self._inputs)}), "
                f"got an array of shape {rows.shape}"
            )
        results = np.empty((len(rows), 3, len(self._outputs)))
        edges = np.linspace(0, len(rows), max(1, min(threads, len(rows))) + 1).astype(int).tolist()

        def part(begin: int, end: int) -> None:
            """Infer some of the rows; raise for the first row with an error."""
            status, bad = self._rows(rows[begin:end], results[begin:end])
            if status:
                raise self._error(status, rows[begin + bad].tolist(), f"row {begin + bad}: ")

        if len(edges) == 2:
            part(*edges)
        else:
            with ThreadPoolExecutor(len(edges) - 1) as pool:
                for done in [pool.submit(part, *each) for each in pairwise(edges)]:
                    done.result()
        return results.transpose(1, 0, 2)

    def fired_rules(self, *inputs: float) -> list[FiredRule]:
        """Return the rules that fire, strongest first; for type 3 over the full footprints.

        Raises:
            InvalidInput: As for a call.
        """
        self._all(inputs)  # raises for invalid inputs
        if self._is_sliced:
            return Inference(self.system.with_secondary(None)).fired_rules(*inputs)
        x = np.array(inputs, dtype=np.float64)
        lower, upper = rule_strengths(self._floats, self._integers, x)
        results = [
            FiredRule(k + 1, self.system.rules[k], float(lower[k]), float(upper[k]))
            for k in np.flatnonzero(upper > 0.0).tolist()
        ]
        return sorted(results, key=lambda each: -each.upper)

    @cached_property
    def _infer_one(self) -> Callable[..., int]:
        inputs = (0.0,) * self._count
        return entry_point(infer_one, self._floats, self._integers, inputs, self._blank)

    def _rows(self, rows: Array, results: Array) -> tuple[int, int]:
        return infer_rows(self._floats, self._integers, self._slices, rows, results)

    def _all(self, inputs: Sequence[float]) -> Float[Array, "3 outputs"]:
        """Return value, least and greatest of every output."""
        x = tuple(map(float, inputs))
        if len(x) != len(self._inputs):
            raise InvalidInput(
                f"needs {len(self._inputs)} inputs ({', '.join(self._inputs)}), got {len(x)}"
            )
        results = np.empty((1, 3, len(self._outputs)))
        status, _ = self._rows(np.array([x]), results)
        if status:
            raise self._error(status, x)
        row: Array = results[0]
        return row

    def _call_with_collection(
        self, inputs: Mapping[str, float] | Array
    ) -> Array | dict[str, float]:
        if isinstance(inputs, Mapping):
            values = self._all(self._ordered(inputs))[0]
            return dict(zip(self._outputs, values.tolist(), strict=True))
        rows = np.asarray(inputs, dtype=np.float64)
        if rows.ndim == 0 or rows.shape[-1] != len(self._inputs):
            raise InvalidInput(
                f"needs {len(self._inputs)} inputs ({', '.join(self._inputs)}), "
                f"got an array of shape {rows.shape}"
            )
        values = self.batch(rows.reshape(-1, len(self._inputs)))[0]
        reshaped: Array = values.reshape(*rows.shape[:-1], len(self._outputs))
        return reshaped

    def _ordered(self, inputs: Mapping[str, float]) -> list[float]:
        for name in inputs:
            if name not in self._inputs:
                raise InvalidInput(f"there is no input {name!r}{suggestion(name, self._inputs)}")
        for name in self._inputs:
            if name not in inputs:
                raise InvalidInput(f"the input {name!r} is missing")
        return [inputs[name] for name in self._inputs]

    def _error(self, status: int, x: Sequence[float], where: str = "") -> InvalidInput:
        """Return the error for a status, with the name of the input that causes it."""
        if status == NO_RULE:
            given = ", ".join(f"{n} = {v:g}" for n, v in zip(self._inputs, x, strict=True))
            return InvalidInput(f"{where}no rule fires for {given}")
        for variable, value in zip(self.system.inputs, x, strict=True):
            if status == NOT_FINITE and not np.isfinite(value):
                return InvalidInput(
                    f"{where}the input {variable.name!r} is {value}, not a number"
                    if np.isnan(value)
                    else f"{where}the input {variable.name!r} is infinite"
                )
            if status != NOT_FINITE and not variable.low <= value <= variable.high:
                return InvalidInput(
                    f"{where}the input {variable.name!r} is {value:g}, "
                    f"outside its range [{variable.low:g}, {variable.high:g}]"
                )
        raise AssertionError(status)


def _check(options: InferenceOptions) -> None:
    choices = {
        "centroid": (options.centroid, get_args(Centroid)),
        "reduction": (options.reduction, get_args(Reduction)),
        "algorithm": (options.algorithm, ALGORITHMS),
        "out_of_range": (options.out_of_range, get_args(OutOfRange)),
        "no_rule": (options.no_rule, get_args(NoRule)),
    }
    for name, (value, known) in choices.items():
        check_choice(name, value, known)
    if not 2 <= options.samples <= MAX_SAMPLES:
        raise InvalidInput(
            f"the samples (--samples) must be 2 to {MAX_SAMPLES}, got {options.samples}"
        )
    if not 1 <= options.slices <= MAX_SLICES:
        raise InvalidInput(f"needs 1 to {MAX_SLICES} slices, got {options.slices}")
