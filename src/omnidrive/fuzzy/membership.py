"""Membership functions: Matlab's shapes, raised cosines, and polylines through given points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import cos, exp, inf, isfinite, pi
from typing import NamedTuple, overload

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.checks import check_numbers

TRAPEZOID, SMOOTH, GAUSS, BELL, SIGMOID_DIFFERENCE, SIGMOID_PRODUCT, POINTS, COSINE = range(8)

_NARROW = 1e-300  # stands for a width of 0 in a quotient


class Shape(NamedTuple):
    """A shape of membership functions."""

    parameters: tuple[str, ...]
    """Names of the parameters in Matlab's order; empty if their number is arbitrary."""
    ascending: bool
    """Whether the parameters must be ascending."""
    nonzero: tuple[int, ...]
    """Indices of the parameters that must not be zero."""
    kernel: int
    """Code of the compiled curve."""
    curve: Callable[..., tuple[float, float, float, float]]
    """Maps the parameters to those of the compiled curve."""


def _identity(a: float, b: float, c: float, d: float) -> tuple[float, float, float, float]:
    return a, b, c, d


def _step(a: float, b: float) -> tuple[float, float]:
    """Return the ends of an S curve; a step in their middle if a >= b, as in Matlab."""
    return (a, b) if a < b else (0.5 * (a + b), 0.5 * (a + b))


def _gauss(s1: float, c1: float, s2: float, c2: float) -> tuple[float, float, float, float]:
    return s1 or _NARROW, c1, s2 or _NARROW, c2


SHAPES: dict[str, Shape] = {
    "trimf": Shape(("a", "b", "c"), True, (), TRAPEZOID, lambda a, b, c: (a, b, b, c)),
    "trapmf": Shape(("a", "b", "c", "d"), True, (), TRAPEZOID, _identity),
    "linzmf": Shape(("a", "b"), True, (), TRAPEZOID, lambda a, b: (-inf, -inf, a, b)),
    "linsmf": Shape(("a", "b"), True, (), TRAPEZOID, lambda a, b: (a, b, inf, inf)),
    "zmf": Shape(("a", "b"), False, (), SMOOTH, lambda a, b: (-inf, -inf, *_step(a, b))),
    "smf": Shape(("a", "b"), False, (), SMOOTH, lambda a, b: (*_step(a, b), inf, inf)),
    "pimf": Shape(
        ("a", "b", "c", "d"), False, (), SMOOTH, lambda a, b, c, d: (*_step(a, b), *_step(c, d))
    ),
    "gaussmf": Shape(("sigma", "c"), False, (), GAUSS, lambda s, c: _gauss(s, c, s, c)),
    "gauss2mf": Shape(("sigma1", "c1", "sigma2", "c2"), False, (), GAUSS, _gauss),
    "gbellmf": Shape(("a", "b", "c"), False, (0,), BELL, lambda a, b, c: (a, b, c, 0.0)),
    "sigmf": Shape(("a", "c"), False, (), SIGMOID_PRODUCT, lambda a, c: (a, c, 1.0, -inf)),
    "dsigmf": Shape(("a1", "c1", "a2", "c2"), False, (), SIGMOID_DIFFERENCE, _identity),
    "psigmf": Shape(("a1", "c1", "a2", "c2"), False, (), SIGMOID_PRODUCT, _identity),
    "cosinemf": Shape(("a", "c"), False, (), COSINE, lambda a, c: (a or _NARROW, c, 0.0, 0.0)),
    "pointsmf": Shape((), True, (), POINTS, _identity),
}
"""Shapes by their names in Matlab.

Two are not Matlab's: ``pointsmf`` (x1, y1, x2, y2, ...) and ``cosinemf``, the raised cosine
(1 + cos(pi (x - c)/a))/2 within a of c."""

MATLAB_SHAPES = tuple(each for each in SHAPES if each not in {"pointsmf", "cosinemf"})

MAX_POINTS = 10_000
"""Greatest number of points of a ``pointsmf``."""


@dataclass(frozen=True, slots=True)
class Membership:
    """A membership function: maps a number to its degree of membership, 0 to 1.

    The formulas are Matlab's (Fuzzy Logic Toolbox, "Foundations of Fuzzy Logic"). The degree at a
    vertical side is 1, so that a triangle, a trapezoid or a ``pimf`` without width is a fuzzy
    singleton: 1 at one point and 0 elsewhere. So is a ``gaussmf`` with sigma 0; a side of a
    ``gauss2mf`` with sigma 0 is vertical. The formulas square sigma: its sign has no effect,
    as in Matlab. An S or Z curve with a >= b is a step at (a + b)/2.

    Attributes:
        shape: A name of :data:`SHAPES`.
        parameters: In Matlab's order, in the unit of the variable; for ``pointsmf`` the pairs x, y
            of a polyline with ascending x that is constant beyond its ends.

    Raises:
        InvalidInput: The shape is unknown, or the parameters are invalid.
    """

    shape: str
    parameters: tuple[float, ...]

    def __post_init__(self) -> None:
        kind = SHAPES.get(self.shape)
        if kind is None:
            raise InvalidInput(
                f"there is no membership function {self.shape!r}; there are {', '.join(SHAPES)}"
            )
        object.__setattr__(self, "parameters", tuple(map(float, self.parameters)))
        p, name = self.parameters, f"{self.shape} {_parameter_text(self.parameters)}"
        check_numbers(name, *p)
        if kind.kernel == POINTS:
            _check_points(name, p)
            return
        if len(p) != len(kind.parameters):
            raise InvalidInput(
                f"{name}: needs {len(kind.parameters)} parameters "
                f"({', '.join(kind.parameters)}), got {len(p)}"
            )
        if kind.ascending and any(a > b for a, b in pairwise(p)):
            raise InvalidInput(f"{name}: needs {' <= '.join(kind.parameters)}")
        if any(p[k] == 0.0 for k in kind.nonzero):
            raise InvalidInput(f"{name}: {kind.parameters[kind.nonzero[0]]} must not be 0")
        if kind.kernel == COSINE and p[0] < 0.0:
            raise InvalidInput(f"{name}: a must not be negative")

    @overload
    def __call__(self, x: float) -> float: ...
    @overload
    def __call__(self, x: Float[Array, "*shape"]) -> Float[Array, "*shape"]: ...
    def __call__(self, x: float | Array) -> float | Array:
        """Return the degree of membership of a number, or of every element of an array."""
        at = np.asarray(x, dtype=np.float64)
        curves = Curves.of((self,))
        degrees = np.array([degree(curves, 0, v) for v in at.ravel().tolist()])
        return degrees.reshape(at.shape) if at.ndim else float(degrees[0])

    @property
    def is_piecewise_linear(self) -> bool:
        """Whether the function consists of straight segments."""
        return SHAPES[self.shape].kernel in {TRAPEZOID, POINTS} or self._smooth_point is not None

    @property
    def _smooth_point(self) -> float | None:
        """Point of a singleton that is the limit of smooth functions; None for other functions."""
        p = self.parameters
        if self.shape in {"gaussmf", "cosinemf"} and p[0] == 0.0:
            return p[1]
        if self.shape == "gauss2mf" and p[0] == p[2] == 0.0 and p[1] == p[3]:
            return p[1]
        if self.shape == "pimf" and p[0] >= p[1] and p[2] >= p[3] and p[0] + p[1] == p[2] + p[3]:
            return 0.5 * (p[0] + p[1])
        return None

    @property
    def vertices(self) -> tuple[tuple[float, float], ...]:
        """Corners (x, degree) of a piecewise linear function, from left to right.

        A vertical side is two corners with one x. Beyond the corners, the function is constant.

        Raises:
            InvalidInput: The function is not piecewise linear.
        """
        if not self.is_piecewise_linear:
            raise InvalidInput(f"{self.shape} is not piecewise linear")
        p = self.parameters
        if (at := self._smooth_point) is not None:
            return (at, 0.0), (at, 1.0), (at, 0.0)
        if self.shape == "pointsmf":
            return tuple(zip(p[::2], p[1::2], strict=True))
        a, b, c, d = SHAPES[self.shape].curve(*p)
        corners = [(a, 0.0), (b, 1.0)] if isfinite(a) else []
        corners += [(c, 1.0), (d, 0.0)] if isfinite(d) else []
        return tuple(corner for corner, _ in groupby(corners))

    @property
    def forward(self) -> Membership:
        """Equal function in which every S or Z curve with a > b is a step with a = b."""
        p = self.parameters
        if self.shape not in {"smf", "zmf", "pimf"} or all(
            a <= b for a, b in zip(p[::2], p[1::2], strict=True)
        ):
            return self
        steps = [x for a, b in zip(p[::2], p[1::2], strict=True) for x in _step(a, b)]
        return Membership(self.shape, tuple(steps))

    @property
    def core_midpoint(self) -> float:
        """Boundary between the left and the right side; infinite for a one-sided function."""
        p = self.parameters
        if self.shape == "pointsmf":
            top = max(p[1::2])
            peaks = [x for x, y in self.vertices if y == top]
            return 0.5 * (peaks[0] + peaks[-1])
        if self.shape in {"sigmf", "linsmf", "linzmf", "smf", "zmf"}:
            is_rising = p[0] >= 0.0 if self.shape == "sigmf" else self.shape in {"linsmf", "smf"}
            return inf if is_rising else -inf
        at = {
            "gaussmf": (1, 1), "gauss2mf": (1, 3), "gbellmf": (2, 2), "trimf": (1, 1),
            "cosinemf": (1, 1),
        }  # fmt: skip
        i, j = at.get(self.shape, (1, 2) if "sig" not in self.shape else (1, 3))
        return 0.5 * (p[i] + p[j])

    def __str__(self) -> str:
        return f"{self.shape} {_parameter_text(self.parameters)}"


def _parameter_text(parameters: tuple[float, ...]) -> str:
    shown = " ".join(f"{p:.10g}" for p in parameters[:8])
    return f"[{shown}{' ...' if len(parameters) > 8 else ''}]"


def _check_points(name: str, p: tuple[float, ...]) -> None:
    if len(p) < 2 or len(p) % 2 or len(p) > 2 * MAX_POINTS:
        raise InvalidInput(
            f"{name}: needs 1 to {MAX_POINTS} pairs of x and degree, got {len(p)} numbers"
        )
    if any(a > b for a, b in pairwise(p[::2])):
        raise InvalidInput(f"{name}: the x of its points must ascend")
    if not all(0.0 <= y <= 1.0 for y in p[1::2]):
        raise InvalidInput(f"{name}: every degree must lie in [0, 1]")


class Curves(NamedTuple):
    """Membership functions as flat arrays for :func:`degree`."""

    kernels: Int[Array, " functions"]
    """Code of the curve of each function."""
    parameters: Float[Array, " parameters"]
    """Four numbers per function; for a polyline, its first point and number of points."""
    points: Float[Array, " coordinates"]
    """x and degree of every point of every polyline."""

    @staticmethod
    def of(functions: Sequence[Membership]) -> Curves:
        """Return the curves of the functions, in their order."""
        kernels: list[int] = []
        parameters: list[float] = []
        points: list[float] = []
        for function in functions:
            kind = SHAPES[function.shape]
            kernels.append(kind.kernel)
            if kind.kernel == POINTS:
                parameters += [len(points) / 2, len(function.parameters) / 2, 0.0, 0.0]
                points += function.parameters
            else:
                parameters += kind.curve(*function.parameters)
        return Curves(np.array(kernels, dtype=np.int64), np.array(parameters), np.array(points))


@compiled
def degree(curves: Curves, k: int, x: float) -> float:  # noqa: PLR0911
    """Return the degree of membership of ``x`` in function number ``k``."""
    kernel = curves.kernels[k]
    p: float = curves.parameters[4 * k]
    q: float = curves.parameters[4 * k + 1]
    r: float = curves.parameters[4 * k + 2]
    s: float = curves.parameters[4 * k + 3]
    if kernel == TRAPEZOID:
        if x < p or x > s:
            return 0.0
        if x < q:
            return (x - p) / (q - p)
        return (s - x) / (s - r) if x > r else 1.0
    if kernel == SMOOTH:
        return _s_curve(p, q, x) * _s_curve(-s, -r, -x)
    if kernel == GAUSS:
        left = exp(-0.5 * ((x - q) / p) ** 2) if x < q else 1.0
        return left * exp(-0.5 * ((x - s) / r) ** 2) if x > s else left
    if kernel == BELL:
        distance: float = abs((x - r) / p) ** (2.0 * q)
        return 1.0 / (1.0 + distance)
    if kernel == SIGMOID_DIFFERENCE:
        return abs(_sigmoid(p, q, x) - _sigmoid(r, s, x))
    if kernel == SIGMOID_PRODUCT:
        return _sigmoid(p, q, x) * _sigmoid(r, s, x)
    if kernel == COSINE:
        return 0.5 * (1.0 + cos(pi * (x - q) / p)) if abs(x - q) <= p else 0.0
    return _polyline(curves.points, int(p), int(q), x)


@compiled
def _s_curve(a: float, b: float, x: float) -> float:
    """Return Zadeh's S curve: two parabolas from 0 at a to 1 at b."""
    if x >= b:
        return 1.0
    if x <= a:
        return 0.0
    fraction = (x - a) / (b - a)
    return 2.0 * fraction * fraction if fraction <= 0.5 else 1.0 - 2.0 * (1.0 - fraction) ** 2


@compiled
def _sigmoid(slope: float, centre: float, x: float) -> float:
    return 1.0 / (1.0 + exp(-slope * (x - centre)))


@compiled
def _polyline(points: Float[Array, " coordinates"], first: int, count: int, x: float) -> float:
    """Return the value of a polyline; the greater degree where two points share an x."""
    last = first + count - 1
    x0: float = points[2 * first]
    y0: float = points[2 * first + 1]
    best = y0 if x <= x0 else -1.0
    for k in range(first, last + 1):
        x1: float = points[2 * k]
        y1: float = points[2 * k + 1]
        if x1 == x:
            best = max(best, y1)
        elif x1 > x:
            return best if best >= 0.0 else y0 + (y1 - y0) * (x - x0) / (x1 - x0)
        x0, y0 = x1, y1
    return best if best >= 0.0 else y0
