"""What tunes gains: no system, or the fuzzy systems of the paper's text and its published code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from math import isfinite, nan
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.choices import OutOfRange
from omnidrive.compiled import CompiledFunction, compilable_as, compiled
from omnidrive.compiled.views import uncounted
from omnidrive.control.pid.fuzzy_options import FuzzyOptions
from omnidrive.control.pid.laws import GainChange
from omnidrive.control.pid.rules import paper_rules, published_rules
from omnidrive.fuzzy import Footprint, FuzzySystem, Inference, Secondary
from omnidrive.fuzzy.kernels import infer_rows
from omnidrive.parameter import check_choice

Tuner = Callable[[float, float], GainChange]
"""Maps the scaled error and its scaled change to the changes of kp, ki and kd."""

Kind = Literal["t1", "t2", "t3"]
Preset = Literal["paper", "published-code"]

PAPER_FOOTPRINT = Footprint(scale=1.0, left=0.3)
"""Footprint of every set in the paper's text."""
PUBLISHED_INPUTS = Footprint(scale=0.7, left=0.2)
"""Footprint of the input sets in the published code."""
PUBLISHED_OUTPUTS = Footprint(scale=1.0, left=0.2)
"""Footprint of the output sets in the published code: Matlab's default."""

_PRESETS: dict[Preset, tuple[Callable[[], Int[Array, "7 7 3"]], Footprint, Footprint]] = {
    "paper": (paper_rules, PAPER_FOOTPRINT, PAPER_FOOTPRINT),
    "published-code": (published_rules, PUBLISHED_INPUTS, PUBLISHED_OUTPUTS),
}
"""Rule table and footprints of inputs and outputs, by preset."""

_PUBLISHED = FuzzyOptions()

SLICES = 5
"""Number of levels of the z-slices of type-3 sets.

Twice as many change no output by 1e-4, 1/2000 of its range."""


@lru_cache(maxsize=64)
def gain_inference(kind: Kind, preset: Preset, options: FuzzyOptions = _PUBLISHED) -> Inference:
    """Return the compiled fuzzy system of a preset.

    ``paper`` has the paper's table, exact centroids and, for types 2 and 3, centre-of-sets type
    reduction; ``published-code`` has the code's table and Matlab's centroid. The paper has no
    type 3: its sets are those of type 2 with the default secondary membership. A system in a file
    has the same options, but samples of the centroid where it has no closed form; one of type 1
    has the footprints of the preset for types 2 and 3.

    Inputs outside [-1, 1] are not changed, as in Matlab: no rule of the paper's sets fires there,
    so that the outputs are zero. A system in a file has its defaults where no rule fires: without
    any, the middles of its ranges. Inputs of a Sugeno system are clamped to [-1, 1], because
    its linear functions would exceed the greatest change of a gain beyond.

    Args:
        kind: ``t1``, ``t2`` or ``t3``.
        preset: The preset.
        options: Membership functions, footprints and rules that differ from the preset.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    system = gain_system(kind, preset, options)
    beyond: OutOfRange = "clamp" if system.is_sugeno else "matlab"
    if preset == "published-code":
        return Inference(system, centroid="matlab", out_of_range=beyond, slices=SLICES)
    if kind == "t1":
        return Inference(system, out_of_range=beyond)
    return Inference(system, reduction="cos", out_of_range=beyond, slices=SLICES)


def gain_system(kind: Kind, preset: Preset, options: FuzzyOptions = _PUBLISHED) -> FuzzySystem:
    """Return the fuzzy system that :func:`gain_inference` compiles, of the same arguments.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    check_choice("preset", preset, get_args(Preset))
    check_choice("kind of fuzzy system", kind, get_args(Kind))
    rules, inputs, outputs = _PRESETS[preset]
    system = options.system(rules())
    if kind != "t1" and system.type == 1:
        system = system.with_footprint(*options.footprints(inputs, outputs))
    return system.with_secondary(Secondary()) if kind == "t3" else system


def resolved_options(options: FuzzyOptions, preset: Preset) -> FuzzyOptions:
    """Return the options of a fuzzy system with all values, from those of a preset."""
    rules, inputs, outputs = _PRESETS[preset]
    return options.resolved(rules(), inputs, outputs)


@dataclass(frozen=True, eq=False, slots=True)
class FuzzyTuner:
    """A :data:`Tuner` that evaluates a fuzzy system.

    Attributes:
        inference: The compiled system; its outputs are the changes of kp, ki and kd.
    """

    inference: Inference

    def __call__(self, error: float, change: float) -> GainChange:
        """Return the changes; nan for inputs that are not finite, which fails the step."""
        if not (isfinite(error) and isfinite(change)):
            return nan, nan, nan
        kp, ki, kd = self.inference(error, change).tolist()
        return kp, ki, kd


def fuzzy_tuner(kind: Kind, preset: Preset, options: FuzzyOptions = _PUBLISHED) -> FuzzyTuner:
    """Return the tuner of a preset: from scaled error and change to the changes of kp, ki and kd.

    Inputs outside [-1, 1] have the effect stated there; those that are not finite give nan.
    Arguments are those of :func:`gain_inference`.

    Raises:
        InvalidInput: The kind or preset is unknown.
    """
    return FuzzyTuner(gain_inference(kind, preset, options))


def no_tuning(error: float, change: float) -> GainChange:
    """Return zero changes, a :data:`Tuner` for constant gains: a classical PID."""
    return (0.0, 0.0, 0.0)


class PackedTuner(NamedTuple):
    """A :data:`Tuner` of this package in kernels."""

    function: Any
    """:func:`no_changes` or :func:`inferred_changes` as machine code, so that one kernel serves
    both, and is compiled without the inference."""
    floats: Float[Array, " floats"]
    """Arrays of a fuzzy system, as for :func:`~omnidrive.fuzzy.kernels.infer_rows`."""
    integers: Int[Array, " integers"]
    slices: Int[Array, "slices 4"]


_NO_SYSTEM = (np.empty(0), np.empty(0, np.int64), np.empty((0, 4), np.int64))


def packed_tuner(tune: Tuner) -> PackedTuner | None:
    """Return a tuner for kernels; None: it is not one of this package, or Numba is disabled."""
    if not hasattr(inferred_changes, "py_func"):
        return None
    if isinstance(tune, FuzzyTuner):
        return PackedTuner(_machine_code(inferred_changes), *tune.inference.arrays)
    return PackedTuner(_machine_code(no_changes), *_NO_SYSTEM) if tune is no_tuning else None


@cache
def _machine_code(kernel: Callable[..., GainChange]) -> CompiledFunction:
    return CompiledFunction(kernel, *_NO_SYSTEM, 0.0, 0.0)


@compiled
def no_changes(
    floats: Float[Array, " floats"],
    integers: Int[Array, " integers"],
    slices: Int[Array, "slices 4"],
    error: float,
    change: float,
) -> GainChange:
    """Return what :func:`no_tuning` returns."""
    return 0.0, 0.0, 0.0


@compiled
def inferred_changes(
    floats: Float[Array, " floats"],
    integers: Int[Array, " integers"],
    slices: Int[Array, "slices 4"],
    error: float,
    change: float,
) -> GainChange:
    """Return what a :class:`FuzzyTuner` returns; nan where it raises an error."""
    if not (isfinite(error) and isfinite(change)):
        return nan, nan, nan
    rows, results = np.empty((1, 2)), np.empty((1, 3, 3))
    rows[0, 0], rows[0, 1] = error, change
    status, _ = infer_rows(floats, integers, slices, rows, results)
    if status != 0:
        return nan, nan, nan
    return results[0, 0, 0], results[0, 0, 1], results[0, 0, 2]


def _packed_changes(tune: PackedTuner, error: float, change: float) -> GainChange:
    if len(tune.slices) == 0:  # as no_changes, without the call
        return 0.0, 0.0, 0.0
    kp, ki, kd = tune.function(tune.floats, tune.integers, tune.slices, error, change)
    return kp, ki, kd


def _uncounted(channels: Any) -> Any:
    return uncounted(channels)


@compilable_as(_uncounted)
def borrowed(channels: Any) -> Any:
    """Return an argument of a kernel, whose arrays need no reference counting; itself in Python."""
    return channels


@compilable_as(_packed_changes)
def gain_change(tune: Any, error: float, change: float) -> GainChange:
    """Return the result of a :data:`Tuner`, in kernels that of a :class:`PackedTuner`."""
    kp, ki, kd = tune(error, change)
    return kp, ki, kd
