"""Inference with invalid and extreme inputs: errors, policies, and outputs that are never NaN."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidFuzzyFile, InvalidInput
from omnidrive.fuzzy.files import load, save
from omnidrive.fuzzy.inference import Inference
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.rules import Is, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    Footprint,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
    Secondary,
)
from tests.examples import examples
from tests.fuzzy import oracle
from tests.fuzzy.systems import systems

NAN, INF = float("nan"), float("inf")


def heater(**output):
    """Return a system in which no rule fires between 20 and 22 degrees."""
    cold = FuzzySet("cold", Membership("linzmf", (10, 20)))
    hot = FuzzySet("hot", Membership("trimf", (22, 30, 38)))
    wet = FuzzySet("wet", Membership("linsmf", (0, 100)))
    sets = tuple(FuzzySet(n, Membership("trimf", (a, b, c)))
                 for n, a, b, c in (("off", 0, 1, 2), ("on", 2, 3, 4)))  # fmt: skip
    return FuzzySystem(
        "heater",
        (InputVariable("temp", 0, 35, (cold, hot)), InputVariable("damp", 0, 100, (wet,))),
        (OutputVariable("power", 0, 5, sets, **output),),
        (
            Rule(Is("temp", "cold"), (Is("power", "on"),)),
            Rule(Is("temp", "hot"), (Is("power", "off"),)),
        ),
    )


SYSTEMS = {
    1: heater(),
    2: heater().with_footprint(Footprint(0.9, 0.1)),
    3: heater().with_footprint(Footprint(0.9, 0.1), secondary=Secondary()),
}


@pytest.mark.parametrize("type_", SYSTEMS)
@pytest.mark.parametrize("bad", [NAN, INF, -INF])
@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("policy", ["clamp", "matlab", "raise"])
def test_error_names_input_that_is_not_finite(type_, bad, index, policy):
    run = Inference(SYSTEMS[type_], out_of_range=policy)
    x = [15.0, 50.0]
    x[index] = bad
    name = ("temp", "damp")[index]
    means = "not a number" if np.isnan(bad) else "infinite"
    rows = np.array([[15.0, 50.0]] * 3 + [x])
    for call in (lambda: run(*x), lambda: run(np.array(x)),
                 lambda: run.interval(*x), lambda: run.fired_rules(*x),
                 lambda: run({"temp": x[0], "damp": x[1]})):  # fmt: skip
        with pytest.raises(InvalidInput, match=f"{name!r} is .*{means}"):
            call()
    for threads in (1, 3):
        with pytest.raises(InvalidInput, match=rf"row 3: the input {name!r} is .*{means}"):
            run.batch(rows, threads=threads)


@pytest.mark.parametrize("type_", SYSTEMS)
def test_out_of_range_policies(type_):
    system = SYSTEMS[type_]
    assert Inference(system)(40.0, 50.0) == Inference(system)(35.0, 50.0)
    assert Inference(system)(-1e300, 1e300) == Inference(system)(0.0, 100.0)
    unchanged = Inference(system, out_of_range="matlab")
    assert unchanged(40.0, 50.0)[0] == 2.5  # no rule fires beyond 38, the end of hot
    raising = Inference(system, out_of_range="raise")
    assert raising(35.0, 0.0) == Inference(system)(35.0, 0.0)
    with pytest.raises(InvalidInput, match=r"'damp' is -1, outside its range \[0, 100\]"):
        raising(15.0, -1.0)
    with pytest.raises(InvalidInput, match=r"row 1: the input 'temp' is 36, outside"):
        raising.batch(np.array([[35.0, 0.0], [36.0, 0.0]]))
    with pytest.raises(InvalidInput, match="'damp' is nan, not a number"):
        raising(36.0, NAN)  # NaN has priority over out of range


@pytest.mark.parametrize("type_", SYSTEMS)
def test_no_rule_policies(type_):
    system = SYSTEMS[type_]
    assert Inference(system)(21.0, 0.0)[0] == 2.5
    assert Inference(system).fired_rules(21.0, 0.0) == []
    seven = replace(system, outputs=(replace(system.outputs[0], default=7.0),))
    value, least, greatest = Inference(seven).batch(np.array([[21.0, 0.0]]))[:, 0, 0]
    assert value == pytest.approx(7.0, abs=1e-14)
    assert (least, greatest) == (value, value)
    raising = Inference(system, no_rule="raise")
    with pytest.raises(InvalidInput, match="no rule fires for temp = 21, damp = 0"):
        raising(21.0, 0.0)
    with pytest.raises(InvalidInput, match="row 2: no rule fires"):
        raising(np.array([[15.0, 0.0], [25.0, 0.0], [21.0, 0.0]]))
    assert raising(15.0, 0.0) == Inference(system)(15.0, 0.0)


def test_output_without_rules_has_its_default():
    system = heater()
    lamp = replace(system.outputs[0], name="lamp", default=4.0)
    both = replace(system, outputs=(*system.outputs, lamp))
    assert Inference(both)(15.0, 0.0)[1] == 4.0
    with pytest.raises(InvalidInput, match="no rule fires"):
        Inference(both, no_rule="raise")(15.0, 0.0)


@pytest.mark.parametrize("type_", SYSTEMS)
def test_wrong_number_or_names_of_inputs(type_):
    run = Inference(SYSTEMS[type_])
    for call in (
        run,
        lambda: run(1.0),
        lambda: run(1.0, 2.0, 3.0),
        lambda: run(np.zeros(3)),
        lambda: run(np.zeros((2, 3))),
        lambda: run(np.array(1.0)),
        lambda: run.interval(1.0),
        lambda: run.fired_rules(1.0, 2.0, 3.0),
    ):
        with pytest.raises(InvalidInput, match=r"2 inputs \(temp, damp\), got"):
            call()
    with pytest.raises(InvalidInput, match="there is no input 'tmep'; did you mean 'temp'"):
        run({"tmep": 1.0, "damp": 2.0})
    with pytest.raises(InvalidInput, match="the input 'damp' is missing"):
        run({"temp": 1.0})
    with pytest.raises(InvalidInput, match="there is no input 'x'"):
        run({"temp": 1.0, "damp": 2.0, "x": 3.0})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 1}, r"\(--samples\) must be 2 to 100000, got 1"),
        ({"samples": 10**9}, r"\(--samples\) must be 2 to"),
        ({"slices": 0}, "needs 1 to"),
        ({"slices": 10**6}, "needs 1 to"),
    ],
)
def test_options_out_of_range(options, message):
    with pytest.raises(InvalidInput, match=message):
        Inference(heater(), **options)


def test_reason_for_missing_exact_centroid_is_named():
    output = replace(heater().outputs[0], aggregation="sum")
    with pytest.raises(InvalidInput, match="aggregated by sum, not max; use --centroid matlab, in"):
        Inference(replace(heater(), outputs=(output,)), centroid="exact")


def test_type_2_supports_only_centroid():
    with pytest.raises(InvalidInput, match="bisector is for type 1"):
        Inference(heater(defuzzifier="bisector").with_footprint(Footprint(0.9)))


EXTREMES = st.sampled_from([0.0, -0.0, 5e-324, 1e-300, 1.0, 1e6, 1e150, 1e300, 1.7e308])


@given(systems(), st.integers(0, 2**32 - 1), st.lists(EXTREMES, min_size=6, max_size=6),
       st.sampled_from(["clamp", "matlab"]), st.sampled_from(["centroid", "cos"]))  # fmt: skip
@examples(100)
def test_outputs_are_finite_and_in_range(system, seed, extremes, policy, reduction):
    """All shapes, norms, types and defuzzifiers; inputs inside, outside and far outside ranges."""
    if system.type > 1 and not system.is_sugeno:
        system = replace(
            system, outputs=tuple(replace(o, defuzzifier="centroid") for o in system.outputs)
        )
    width = len(system.inputs)
    rng = np.random.default_rng(seed)
    corners = [[v.low if rng.random() < 0.5 else v.high for v in system.inputs] for _ in range(3)]
    at = np.concatenate(
        [
            oracle.points_in(system, rng, 6, beyond=0.5),
            np.array(corners),
            [extremes[:width]],
            [[-v for v in extremes[-width:]]],
        ]
    )
    options = {"out_of_range": policy, "samples": 31, "slices": 2, "reduction": reduction}
    results = Inference(system, **options).batch(at)
    assert np.isfinite(results).all()
    if system.is_sugeno:
        return
    for o, output in enumerate(system.outputs):
        slack = 1e-9 * (output.high - output.low)
        default = (output.low + output.high) / 2 if output.default is None else output.default
        low, high = min(output.low, default) - slack, max(output.high, default) + slack
        assert (low <= results[..., o]).all()
        assert (results[..., o] <= high).all()


@pytest.mark.parametrize("implication", ["min", "prod"])
@pytest.mark.parametrize("centroid", ["exact", "matlab"])
@pytest.mark.parametrize("far", [20.0, 37.0, 38.4, 38.55, 50.0])
def test_output_stays_in_range_for_tiny_firing_strength(implication, centroid, far):
    """The tail of a Gaussian is a denormal number with few significant digits."""
    tail = FuzzySet("tail", Membership("gaussmf", (1.0, 0.0)))
    top = FuzzySet("top", Membership("trimf", (1.5, 1.6, 1.7)))
    system = FuzzySystem(
        "s",
        (InputVariable("x", 0, 100, (tail,)),),
        (OutputVariable("y", 1.5, 1.7, (top,)),),
        (Rule(Is("x", "tail"), (Is("y", "top"),)),),
        implication=implication,
    )
    for each in (system, system.with_footprint(Footprint(1.0, 0.0))):
        assert 1.5 <= Inference(each, centroid=centroid)(far)[0] <= 1.7


@pytest.mark.parametrize("suffix", [".fis", ".fll", ".fcl", ".fml"])
def test_numbers_of_files_are_bounded(tmp_path, suffix):
    """Products of the largest numbers do not overflow; larger ones are not loaded."""
    large = LinearFunction("f", 1e100, (1e100,) if suffix != ".fcl" else ())
    cold = FuzzySet("cold", Membership("trapmf", (0, 0, 1e100, 1e100)))
    system = FuzzySystem(
        "s",
        (InputVariable("x", 0, 1e100, (cold,)),),
        (OutputVariable("y", 0, 1, (large,), default=None if suffix == ".fis" else 0.5),),
        (Rule(Is("x", "cold"), (Is("y", "f"),)),),
    )
    path = tmp_path / f"s{suffix}"
    save(system, path)
    rows = np.array([[5.0], [1e100], [-1e308]])
    for policy in ("clamp", "matlab"):
        assert np.isfinite(Inference(load(path), out_of_range=policy).batch(rows)).all()
    text = path.read_text()
    for number in ("-1e308", "1.1e100"):
        path.write_text(number.join(text.rsplit("1e+100", 1)))
        with pytest.raises(InvalidFuzzyFile, match=r"is not a finite number of at most 1e\+100"):
            load(path)


@pytest.mark.parametrize("proposition", [Is("x" * 5000, "cold"), Is("temp", "x" * 5000)])
def test_messages_about_long_names_in_rules_are_short(proposition):
    with pytest.raises(InvalidInput) as caught:
        replace(heater(), rules=(Rule(proposition, (Is("power", "on"),)),))
    assert len(str(caught.value)) < 300
