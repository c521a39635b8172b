"""A slow, direct evaluator of fuzzy systems: the textbook formulas, without compilation.

It shares no code with the inference under test except the data classes and the generators of
systems.
"""

from dataclasses import replace
from itertools import combinations, pairwise
from math import inf

import numpy as np

from omnidrive.fuzzy.rules import And, Is
from omnidrive.fuzzy.variables import Footprint, FuzzySet


def _trapezoid(x, a, b, c, d):
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        rise = np.where(x >= b, 1.0, (x - a) / (b - a) if b > a else 0.0)
        fall = np.where(x <= c, 1.0, (d - x) / (d - c) if d > c else 0.0)
    return np.clip(np.minimum(rise, fall), 0.0, 1.0)


def _s(x, a, b):
    """Matlab's smf, case by case."""
    if a >= b:
        return np.where(x >= (a + b) / 2, 1.0, 0.0)
    below, above = 2 * ((x - a) / (b - a)) ** 2, 1 - 2 * ((x - b) / (b - a)) ** 2
    return np.select([x <= a, x <= (a + b) / 2, x <= b], [0.0, below, above], 1.0)


def _z(x, a, b):
    """Matlab's zmf, case by case."""
    if a >= b:
        return np.where(x <= (a + b) / 2, 1.0, 0.0)
    above, below = 1 - 2 * ((x - a) / (b - a)) ** 2, 2 * ((x - b) / (b - a)) ** 2
    return np.select([x <= a, x <= (a + b) / 2, x <= b], [1.0, above, below], 0.0)


def _gauss(x, s, c):
    if s == 0:
        return np.where(x == c, 1.0, 0.0)
    return np.exp(-((x - c) ** 2) / (2 * s**2))


def _sig(x, a, c):
    z = a * (x - c)
    return np.exp(np.minimum(z, 0.0)) / (1.0 + np.exp(-np.abs(z)))


def _gauss2(x, s1, c1, s2, c2):
    left = np.where(x < c1, _gauss(x, s1, c1), 1.0)
    return left * np.where(x > c2, _gauss(x, s2, c2), 1.0)


def _points(x, *p):
    """Polyline; the greatest degree where several points share an x."""
    at, y = np.array(p[::2]), np.array(p[1::2])
    found = np.empty_like(x)
    for i, v in enumerate(x):
        same = y[at == v]
        before, after = np.flatnonzero(at < v), np.flatnonzero(at > v)
        if len(same):
            found[i] = same.max()
        elif not len(before):
            found[i] = y[0]
        elif not len(after):
            found[i] = y[-1]
        else:
            j, k = before[-1], after[0]
            part = (v - at[j]) / (at[k] - at[j])
            found[i] = (1 - part) * y[j] + part * y[k]
    return found


FORMULAS = {
    "trimf": lambda x, a, b, c: _trapezoid(x, a, b, b, c),
    "trapmf": _trapezoid,
    "linzmf": lambda x, a, b: _trapezoid(x, -inf, -inf, a, b),
    "linsmf": lambda x, a, b: _trapezoid(x, a, b, inf, inf),
    "zmf": _z,
    "smf": _s,
    "pimf": lambda x, a, b, c, d: _s(x, a, b) * _z(x, c, d),
    "gaussmf": _gauss,
    "gauss2mf": _gauss2,
    "gbellmf": lambda x, a, b, c: 1.0 / (1.0 + np.abs((x - c) / a) ** (2 * b)),
    "sigmf": _sig,
    "dsigmf": lambda x, a, c, b, d: np.abs(_sig(x, a, c) - _sig(x, b, d)),
    "psigmf": lambda x, a, c, b, d: _sig(x, a, c) * _sig(x, b, d),
    "cosinemf": lambda x, a, c: np.where(
        np.abs(x - c) <= a, (1 + np.cos(np.pi * (x - c) / (a or 1.0))) / 2, 0.0
    ),
    "pointsmf": _points,
}
"""Formulas of Matlab's documentation; arguments (x, *parameters)."""


def curve(function, x):
    """Return the degrees of an array of points in one membership function."""
    with np.errstate(over="ignore"):
        return FORMULAS[function.shape](np.atleast_1d(np.asarray(x, float)), *function.parameters)


def peak(function):
    """Return the boundary between the left and the right side of a function."""
    p, shape = function.parameters, function.shape
    if shape in {"linsmf", "smf"} or (shape == "sigmf" and p[0] >= 0):
        return inf
    if shape in {"linzmf", "zmf", "sigmf"}:
        return -inf
    if shape == "pointsmf":
        tops = [x for x, y in zip(p[::2], p[1::2], strict=True) if y == max(p[1::2])]
        return (tops[0] + tops[-1]) / 2
    return {
        "trimf": lambda: p[1],
        "gaussmf": lambda: p[1],
        "cosinemf": lambda: p[1],
        "gbellmf": lambda: p[2],
    }.get(shape, lambda: (p[1] + p[2]) / 2 if shape in {"trapmf", "pimf"} else (p[1] + p[3]) / 2)()


def bounds(each, x, z_slice=None):
    """Return lower and upper degrees; ``z_slice``: (level, of the lower secondary)."""
    x = np.atleast_1d(np.asarray(x, float))
    upper = curve(each.upper, x)
    lower = upper
    if isinstance(each.lower, Footprint):
        left, right = each.lower.lags
        lag = np.select(
            [x < peak(each.upper), x > peak(each.upper)], [left, right], min(left, right)
        )
        lower = each.lower.scale * np.maximum(0.0, (upper - lag) / (1.0 - lag))
    elif each.lower is not None:
        lower = curve(each.lower, x)
    if z_slice is None or each.secondary is None:
        return lower, upper
    level, of_lower = z_slice
    secondary, u, middle = each.secondary, (upper - lower) / 2, (upper + lower) / 2
    if of_lower:
        if level > secondary.scale:
            return middle, middle
        level = secondary.lag + (1 - secondary.lag) * level / secondary.scale
    with np.errstate(invalid="ignore"):
        deviation = secondary.spread * 2 * u / (2 * np.sqrt(3))
        half = np.sqrt(-2 * np.log(level)) * deviation
    half = np.where(u > 0, np.minimum(np.nan_to_num(half, nan=0.0, posinf=inf), u), 0.0)
    return middle - half, middle + half


NORMS = {
    "min": min,
    "prod": lambda a, b: a * b,
    "lukasiewicz": lambda a, b: max(0.0, a + b - 1),
    "drastic": lambda a, b: b if a == 1 else a if b == 1 else 0.0,
    "einstein": lambda a, b: a * b / (1 + (1 - a) * (1 - b)),
    "hamacher": lambda a, b: 0.0 if a == b == 0 else a * b / (a + b - a * b),
    "nilpotent": lambda a, b: min(a, b) if a + b > 1 else 0.0,
}
CONORMS = {
    "max": max,
    "probor": lambda a, b: a + b - a * b,
    "bsum": lambda a, b: min(1.0, a + b),
    "drastic": lambda a, b: b if a == 0 else a if b == 0 else 1.0,
    "einstein": lambda a, b: (a + b) / (1 + a * b),
    "hamacher": lambda a, b: (
        # a + b - 2 a b over 1 - a b, without cancellation near a = b = 1
        1.0 if a == b == 1 else (a * (1 - b) + b * (1 - a)) / ((1 - a) + a * (1 - b))
    ),
    "nilpotent": lambda a, b: max(a, b) if a + b < 1 else 1.0,
    "sum": lambda a, b: a + b,
}
CONTINUOUS_NORMS = tuple(n for n in NORMS if n not in {"drastic", "nilpotent"})
CONTINUOUS_CONORMS = tuple(n for n in CONORMS if n not in {"drastic", "nilpotent", "sum"})

HEDGES = {
    "any": lambda a: 1.0,
    "very": lambda a: a**2,
    "somewhat": lambda a: a**0.5,
    "extremely": lambda a: 2 * a**2 if a <= 0.5 else 1 - 2 * (1 - a) ** 2,
    "seldom": lambda a: (a / 2) ** 0.5 if a <= 0.5 else 1 - ((1 - a) / 2) ** 0.5,
}


def strength(system, antecedent, x, z_slice=None):
    """Return the lower and upper degree of an antecedent; ``x``: values by name."""
    if isinstance(antecedent, Is):
        variable = next(v for v in system.inputs if v.name == antecedent.variable)
        low = high = 0.0
        if antecedent.set:
            each = next(s for s in variable.sets if s.name == antecedent.set)
            low, high = (float(b[0]) for b in bounds(each, x[variable.name], z_slice))
        for hedge in reversed(antecedent.hedges):
            if hedge == "not":
                low, high = 1 - high, 1 - low
            else:
                low, high = HEDGES[hedge](low), HEDGES[hedge](high)
        return low, high
    join = NORMS[system.conjunction] if isinstance(antecedent, And) else CONORMS[system.disjunction]
    pairs = [strength(system, part, x, z_slice) for part in antecedent.parts]
    low, high = pairs[0]
    for a, b in pairs[1:]:
        low, high = join(low, a), join(high, b)
    return low, high


def clamped(system, inputs):
    pairs = zip(system.inputs, inputs, strict=True)
    return {v.name: min(max(float(u), v.low), v.high) for v, u in pairs}


def consequents(system, output, inputs, z_slice=None):
    """Yield set, negation and strengths of every rule with a consequent for an output."""
    x = clamped(system, inputs)
    for rule in system.rules:
        low, high = strength(system, rule.antecedent, x, z_slice)
        for term in rule.consequents:
            if term.variable == output.name:
                each = next(s for s in output.sets if s.name == term.set)
                yield each, bool(term.hedges), rule.weight * low, rule.weight * high


def aggregate(system, output, inputs, at, z_slice=None):
    """Return the lower and upper aggregated output at some points."""
    join = CONORMS[output.aggregation]
    join = np.maximum if join is max else np.frompyfunc(join, 2, 1)
    shape = np.minimum if system.implication == "min" else np.multiply
    result = [np.zeros(len(at)), np.zeros(len(at))]
    for each, negated, low, high in consequents(system, output, inputs, z_slice):
        curves = bounds(each, at, z_slice)
        if negated:
            curves = (1 - curves[1], 1 - curves[0])
        for k, one in enumerate((low, high)):
            result[k] = join(result[k], shape(one, curves[k])).astype(float)
    return result


def weighted_interval(at, lower, upper):
    """Return the least and greatest weighted mean for bounded weights, by all switch points.

    ``at`` is a pair: the points whose mean is least and those whose mean is greatest.
    """
    ends = []
    for points, sign in zip(at, (1.0, -1.0), strict=True):
        order = np.argsort(sign * points, kind="stable")
        x, low, high = points[order], lower[order], upper[order]
        means = []
        for k in range(len(x) + 1):
            w = np.where(np.arange(len(x)) < k, high, low)
            if w.sum() > 0:
                means.append(sign * (w @ x) / w.sum())
        ends.append(sign * min(means))
    return tuple(ends)


def centroid(system, inputs, samples=101, z_slice=None):
    """Return value, least and greatest of each output from samples of the aggregated output."""
    found = []
    for output in system.outputs:
        at = even(output, samples)
        lower, upper = aggregate(system, output, inputs, at, z_slice)
        if upper.max() <= 0:
            middle = (output.low + output.high) / 2
            left = right = middle if output.default is None else output.default
        elif system.type == 1:
            left = right = upper @ at / upper.sum()
        else:
            left, right = weighted_interval((at, at), lower, upper)
        found.append(((left + right) / 2, left, right))
    return np.array(found).T


def sugeno(system, inputs):
    """Return value, least and greatest of each output of a Sugeno system."""
    found = []
    x = np.array(list(clamped(system, inputs).values()))
    for output in system.outputs:
        values, lower, upper = [], [], []
        for each, _, low, high in consequents(system, output, inputs):
            coefficients = np.array(each.coefficients or (0.0,) * len(x))
            values.append(each.constant + coefficients @ x)
            lower.append(low)
            upper.append(high)
        z, lower, upper = np.array(values), np.array(lower), np.array(upper)
        if not len(z) or upper.sum() <= 0:
            middle = (output.low + output.high) / 2
            left = right = middle if output.default is None else output.default
        elif output.defuzzifier == "wtsum":
            left = np.minimum(lower * z, upper * z).sum()
            right = np.maximum(lower * z, upper * z).sum()
        else:
            left, right = weighted_interval((z, z), lower, upper)
        found.append(((left + right) / 2, left, right))
    return np.array(found).T


def centre_of_sets(system, inputs, samples=101):
    """Return value, least and greatest of each output from the centroids of the consequents."""
    found = []
    for output in system.outputs:
        at = even(output, samples)
        ends, lower, upper = [], [], []
        for each, negated, low, high in consequents(system, output, inputs):
            curves = bounds(each, at)
            if negated:
                curves = (1 - curves[1], 1 - curves[0])
            if curves[1].max() <= 0:
                curves = (curves[0], np.ones(samples))
            ends.append(weighted_interval((at, at), *curves))
            lower.append(low)
            upper.append(high)
        lower, upper = np.array(lower), np.array(upper)
        if not ends or upper.sum() <= 0:
            middle = (output.low + output.high) / 2
            left = right = middle if output.default is None else output.default
        else:
            left, right = weighted_interval(tuple(np.array(ends).T), lower, upper)
        found.append(((left + right) / 2, left, right))
    return np.array(found).T


def type3(system, inputs, slices, samples=101):
    """Return value, least and greatest: the means over the z-slices, weighted by their levels."""
    total, weight = 0.0, 0.0
    for k in range(slices):
        level = (k + 0.5) / slices
        for of_lower in (False, True):
            total = total + level * centroid(system, inputs, samples, (level, of_lower))
            weight += level
    return total / weight


def pieces(system, output, inputs):
    """Return the upper aggregated output as straight pieces (x0, x1, y0, y1), by all crossings.

    For piecewise linear type-1 sets and aggregation by max.
    """
    found = list(consequents(system, output, inputs))
    corners = {output.low, output.high}
    for each, *_ in found:
        corners |= {x for x, _ in each.upper.vertices if output.low < x < output.high}
    result = []

    def aggregated(x):
        return aggregate(system, output, inputs, x)[1]

    knots = sorted(corners)
    for a, b in pairwise(knots):
        inside = np.array([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b])
        lines = []
        for each, negated, _, high in found:
            y = curve(each.upper, inside)
            y = 1 - y if negated else y
            if system.implication == "min":
                lines += [tuple(y), (high, high)]
            else:
                lines.append(tuple(high * y))
        breaks = {a, b}
        for (p, q), (r, s) in combinations(lines, 2):
            if p - r != q - s:
                x = inside[0] + (inside[1] - inside[0]) * (p - r) / ((p - r) - (q - s))
                if a < x < b:
                    breaks.add(float(x))
        within = sorted(breaks)
        for x0, x1 in pairwise(within):
            near, far = aggregated(np.array([0.75 * x0 + 0.25 * x1, 0.25 * x0 + 0.75 * x1]))
            result.append((x0, x1, near - (far - near) / 2, far + (far - near) / 2))
    return np.array(result)


def without_footprint(system):
    """Return the type-1 system of the upper functions."""

    def plain(variable):
        return replace(
            variable,
            sets=tuple(
                replace(s, lower=None, secondary=None) if isinstance(s, FuzzySet) else s
                for s in variable.sets
            ),
        )

    return replace(
        system, inputs=tuple(map(plain, system.inputs)), outputs=tuple(map(plain, system.outputs))
    )


def points_in(system, rng, count, beyond=0.0):
    """Return random inputs within the ranges, or up to ``beyond`` widths outside of them."""
    low = np.array([v.low for v in system.inputs])
    width = np.array([v.high for v in system.inputs]) - low
    return low + width * (rng.random((count, len(low))) * (1 + 2 * beyond) - beyond)


def even(variable, count):
    """Return evenly spaced samples of the range, symmetric about its middle to the last digit."""
    middle, half = (variable.low + variable.high) / 2, (variable.high - variable.low) / 2
    inner = middle + half * (np.arange(1 - count, count, 2) / (count - 1))[1:-1]
    return np.concatenate([[variable.low], inner, [variable.high]])


def spans(system):
    """Return the width of the range of each output."""
    return np.array([v.high - v.low for v in system.outputs])
