"""Hypothesis strategies for rules and fuzzy systems, restricted as a test requires."""

import functools
import random

from hypothesis import strategies as st

from omnidrive.choices import ALGORITHMS
from omnidrive.fuzzy.membership import SHAPES, SMOOTH, TRAPEZOID, Membership
from omnidrive.fuzzy.norms import AGGREGATIONS, CONORMS, IMPLICATIONS, NORMS
from omnidrive.fuzzy.rule_text import RESERVED, normalised
from omnidrive.fuzzy.rules import HEDGES, And, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    DEFUZZIFIERS,
    Footprint,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
    Secondary,
)

_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"

IDENTIFIERS = st.builds(
    str.__add__, st.sampled_from(_LETTERS), st.text(_LETTERS + "0123456789_", max_size=5)
).filter(lambda name: name.lower() not in RESERVED)
"""Names that every format can write without quotes."""

_PRINTABLE = st.characters(exclude_categories=("C", "Z"))

PRINTABLE_NAMES = (
    IDENTIFIERS
    | st.builds(
        "".join, st.tuples(_PRINTABLE, st.text(_PRINTABLE | st.just(" "), max_size=20), _PRINTABLE)
    )
    | st.sampled_from(["it's", "very", "IS", "a b", "x%y", "x#y", "//", "a:b", "[a]", '"', "'"])
)
"""Names of every kind that a system may have."""


def composite(function):
    """``st.composite`` that leaves the state of ``random`` unchanged: beartype's checks use it."""

    @st.composite
    @functools.wraps(function)
    def drawn(draw, *args, **kwargs):
        state = random.getstate()
        try:
            return function(draw, *args, **kwargs)
        finally:
            random.setstate(state)

    return drawn


MAMDANI_DEFUZZIFIERS = tuple(d for d in DEFUZZIFIERS if not d.startswith("wt"))
SUGENO_DEFUZZIFIERS = ("wtaver", "wtsum")


@composite
def memberships(draw, low=-1.0, high=1.0, shapes=tuple(SHAPES)):
    """Return a membership function over the range from ``low`` to ``high``."""
    shape = draw(st.sampled_from(shapes))
    width = high - low

    def positions(count):
        fraction = st.one_of(st.floats(-0.25, 1.25), st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]))
        each = draw(st.lists(fraction, min_size=count, max_size=count).map(sorted))
        return [low + width * f for f in each]

    def positive(least, most):
        return draw(st.floats(least, most))

    if shape == "pointsmf":
        x = positions(draw(st.integers(1, 5)))
        degrees = [draw(st.floats(0.0, 1.0)) for _ in x]
        return Membership(shape, tuple(v for pair in zip(x, degrees, strict=True) for v in pair))
    if SHAPES[shape].kernel in {TRAPEZOID, SMOOTH}:
        p = positions(len(SHAPES[shape].parameters))
        if p[-1] - p[0] < 0.01 * width:
            p[-1] = p[0] + draw(st.floats(0.1, 1.0)) * width
        return Membership(shape, tuple(p))
    if shape == "gbellmf":
        p = (positive(0.05, 1.0) * width, positive(0.5, 4.0), positions(1)[0])
    elif "gauss" in shape or shape == "cosinemf":
        centres = positions(len(SHAPES[shape].parameters) // 2)
        p = tuple(v for c in centres for v in (positive(0.05, 1.0) * width, c))
    else:
        centres = positions(len(SHAPES[shape].parameters) // 2)
        slope = st.floats(-50.0, 50.0)
        p = tuple(v for c in centres for v in (draw(slope) / width, c))
    return Membership(shape, p)


@composite
def lower_functions(draw, upper):
    """Return a membership function that nowhere exceeds ``upper``; None for some shapes."""
    t, p = draw(st.floats(0.1, 0.9)), upper.parameters
    if upper.shape == "pointsmf":
        return Membership("pointsmf", tuple(v * t if k % 2 else v for k, v in enumerate(p)))
    if upper.shape in {"gaussmf", "gauss2mf", "cosinemf"}:
        return Membership(upper.shape, tuple(v if k % 2 else v * t for k, v in enumerate(p)))
    if upper.shape in {"smf", "linsmf"}:
        return Membership(upper.shape, (min(p[0] + t * (p[1] - p[0]), p[1]), p[1]))
    if upper.shape in {"zmf", "linzmf"}:
        return Membership(upper.shape, (p[0], max(p[1] - t * (p[1] - p[0]), p[0])))
    if upper.shape in {"trimf", "trapmf", "pimf"}:
        left, right = min(p[0] + t * (p[1] - p[0]), p[1]), max(p[-1] - t * (p[-1] - p[-2]), p[-2])
        return Membership(upper.shape, (left, *p[1:-1], right))
    return None


@composite
def footprints(draw):
    lag = st.floats(0.0, 0.9)
    return Footprint(draw(st.floats(0.1, 1.0)), draw(lag), draw(st.none() | lag))


@composite
def fuzzy_sets(draw, name, low, high, shapes, type_, free_lower):
    upper = draw(memberships(low, high, shapes))
    if type_ == 1:
        return FuzzySet(name, upper)
    lower = draw(lower_functions(upper)) if free_lower and draw(st.booleans()) else None
    lower = draw(footprints()) if lower is None else lower
    if type_ == 2:
        return FuzzySet(name, upper, lower)
    positive = st.floats(0.1, 4.0)
    unit = st.floats(0.0, 1.0)
    return FuzzySet(
        name,
        upper,
        lower,
        Secondary(draw(positive | st.just(float("inf"))), draw(unit), 0.9 * draw(unit)),
    )


def distinct(names, count):
    """Return ``count`` different names."""
    return st.lists(names, min_size=count, max_size=count, unique=True)


@composite
def antecedents(draw, variables, hedges=HEDGES, nesting=2):
    """Return a normalised antecedent over ``variables``: pairs of a name and the names of its sets.

    ``nesting=0``: propositions about different variables in their order, joined by one "and" or
    "or", as in a .fis file.
    """

    def proposition(variable, sets):
        chosen = draw(st.lists(st.sampled_from(hedges), max_size=2)) if hedges else []
        if hedges == ("not",):
            chosen = chosen[:1]
        if "any" in chosen:
            return Is(variable, "", (*chosen[: chosen.index("any")], "any"))
        return Is(variable, draw(st.sampled_from(sets)), tuple(chosen))

    def group(depth):
        if depth == 0 or draw(st.integers(0, 2)) == 0:
            return proposition(*draw(st.sampled_from(variables)))
        kind = draw(st.sampled_from([And, Or]))
        return kind(tuple(group(depth - 1) for _ in range(draw(st.integers(1, 3)))))

    if nesting:
        return normalised(group(nesting))
    used = draw(st.sets(st.integers(0, len(variables) - 1), min_size=1))
    parts = tuple(proposition(*variables[k]) for k in sorted(used))
    return normalised(draw(st.sampled_from([And, Or]))(parts))


@composite
def rules(draw, inputs, outputs, hedges=HEDGES, nesting=2, negated_consequents=True, weights=True):
    """Return a normalised rule; ``inputs``, ``outputs``: pairs of a name and names of sets."""
    antecedent = draw(antecedents(inputs, hedges, nesting))
    used = draw(st.sets(st.integers(0, len(outputs) - 1), min_size=1))
    negations = st.sampled_from([(), ("not",)]) if negated_consequents else st.just(())
    consequents = tuple(
        Is(outputs[k][0], draw(st.sampled_from(outputs[k][1])), draw(negations))
        for k in sorted(used)
    )
    light = st.just(0.0) | st.floats(1e-6, 1.0)  # the kernels round tiny strengths to zero
    return Rule(antecedent, consequents, draw(st.just(1.0) | light) if weights else 1.0)


@composite
def systems(
    draw,
    *,
    types=(1, 2, 3),
    sugeno=(False, True),
    shapes=tuple(SHAPES),
    output_shapes=None,
    free_lower=True,
    conjunctions=tuple(NORMS),
    disjunctions=tuple(CONORMS),
    implications=tuple(IMPLICATIONS),
    aggregations=tuple(AGGREGATIONS),
    defuzzifiers=tuple(DEFUZZIFIERS),
    algorithms=ALGORITHMS,
    outputs_alike=False,
    defaults=True,
    linear=True,
    hedges=HEDGES,
    nesting=2,
    negated_consequents=True,
    weights=True,
    names=IDENTIFIERS,
    max_inputs=3,
    max_outputs=2,
    max_sets=3,
    max_rules=4,
):
    """Return a valid, small fuzzy system with normalised antecedents.

    Args:
        draw: Hypothesis' function.
        types: Types to draw from: 1, 2, 3. All sets of a system have its type, except the
            functions of a Sugeno system.
        sugeno: Kinds to draw from: False (Mamdani), True.
        shapes: Names of ``SHAPES`` for the sets.
        output_shapes: Names of ``SHAPES`` for the sets of outputs; None: ``shapes``.
        free_lower: Whether some lower functions are given functions instead of footprints.
        conjunctions: Names of ``NORMS``.
        disjunctions: Names of ``CONORMS``.
        implications: Names of ``IMPLICATIONS``.
        aggregations: Names of ``AGGREGATIONS``.
        defuzzifiers: Names for both kinds of system; drawn are those that fit the kind.
        algorithms: Algorithms of type reduction; a type-1 system always has "km".
        outputs_alike: Whether all outputs have the same aggregation and the same defuzzifier.
        defaults: Whether some outputs have a default.
        linear: Whether linear functions may have coefficients.
        hedges: Hedges in antecedents.
        nesting: Greatest depth of and/or in an antecedent; 0: see :func:`antecedents`.
        negated_consequents: Whether a Mamdani consequent may be negated.
        weights: Whether some rules have a weight other than 1.
        names: Strategy of the names, also of the system's name.
        max_inputs: Greatest number of inputs; likewise ``max_outputs``, ``max_sets`` (of one
            variable) and ``max_rules``.
    """
    type_, is_sugeno = draw(st.sampled_from(types)), draw(st.sampled_from(sugeno))
    n, m = draw(st.integers(1, max_inputs)), draw(st.integers(1, max_outputs))
    called = draw(distinct(names, n + m))
    some = st.integers(1, max_sets)
    number = st.floats(-100.0, 100.0)

    def span():
        low = draw(st.floats(-100.0, 100.0) | st.just(-1.0))
        return low, low + draw(st.floats(0.1, 100.0) | st.just(2.0))

    def sets(low, high, shapes):
        return tuple(
            draw(fuzzy_sets(name, low, high, shapes, type_, free_lower))
            for name in draw(some.flatmap(lambda count: distinct(names, count)))
        )

    def functions():
        for name in draw(some.flatmap(lambda count: distinct(names, count))):
            count = n if linear and draw(st.booleans()) else 0
            coefficients = draw(st.lists(number, min_size=count, max_size=count))
            yield LinearFunction(name, draw(number), tuple(coefficients))

    inputs = []
    for name in called[:n]:
        low, high = span()
        inputs.append(InputVariable(name, low, high, sets(low, high, shapes)))

    suiting = SUGENO_DEFUZZIFIERS if is_sugeno else MAMDANI_DEFUZZIFIERS
    manner = st.tuples(
        st.sampled_from(aggregations), st.sampled_from([d for d in defuzzifiers if d in suiting])
    )
    alike = draw(manner)
    outputs = []
    for name in called[n:]:
        low, high = span()
        own = (
            tuple(functions())
            if is_sugeno
            else sets(low, high, shapes if output_shapes is None else output_shapes)
        )
        default = draw(st.none() | number) if defaults else None
        outputs.append(
            OutputVariable(
                name, low, high, own, *(alike if outputs_alike else draw(manner)), default
            )
        )

    known = [[(v.name, [s.name for s in v.sets]) for v in vs] for vs in (inputs, outputs)]
    one = rules(*known, hedges, nesting, negated_consequents and not is_sugeno, weights)
    return FuzzySystem(
        draw(names),
        tuple(inputs),
        tuple(outputs),
        tuple(draw(st.lists(one, min_size=1, max_size=max_rules))),
        draw(st.sampled_from(conjunctions)),
        draw(st.sampled_from(disjunctions)),
        draw(st.sampled_from(implications)),
        draw(st.sampled_from(algorithms)) if type_ > 1 else "km",
    )
