"""Figures of fuzzy systems: membership functions, control surfaces and the rule viewer."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from omnidrive.control.pid import gain_inference
from omnidrive.errors import InvalidInput
from omnidrive.evaluation.figures import control_surface, membership_figure, rule_viewer, save
from omnidrive.fuzzy import (
    Footprint,
    FuzzySet,
    FuzzySystem,
    Inference,
    InputVariable,
    LinearFunction,
    Membership,
    OutputVariable,
    Secondary,
    parse_rule,
)
from omnidrive.fuzzy.aggregated_output import aggregated_outputs, implied_consequent

PAPER = gain_inference("t1", "paper").system
FOOTPRINT = Footprint(0.8, 0.2, 0.1)

WIDE = Membership("trapmf", (-1, 0, 1, 2))


def parts(count, low=0.0, high=1.0, shape="trimf"):
    """Return sets S1, S2, ... that cover a range."""
    width = (high - low) / (count - 1)
    peaks = [low + k * width for k in range(count)]
    functions = [
        (at - width, at, at + width) if shape == "trimf" else (0.4 * width, at) for at in peaks
    ]
    return tuple(FuzzySet(f"S{k}", Membership(shape, p)) for k, p in enumerate(functions, 1))


def system(rules, inputs=3, **options):
    names = ("x", "y", "z")[:inputs]
    output = OutputVariable("u", -1, 1, parts(4, -1, 1), options.pop("aggregation", "max"))
    return FuzzySystem(
        "some",
        tuple(InputVariable(name, 0, 1, parts(3, shape="gaussmf")) for name in names),
        (output,),
        tuple(map(parse_rule, rules)),
        **options,
    )


MIXED = system(
    ("if x is S1 and not y is S2 or z is very S3 then u is S1 with 0.8",
     "if x is S3 then u is not S4", "if z is S2 and y is any then u is S3"),
)  # fmt: skip
SUGENO = FuzzySystem(
    "linear",
    (InputVariable("x", 0, 1, parts(3)),),
    (OutputVariable("u", 0, 1, (LinearFunction("a", 0.2), LinearFunction("b", 1.0, (2.0,)))),),
    tuple(map(parse_rule, ("if x is S1 then u is a", "if x is S2 then u is b"))),
)


def centroid(curve):
    """Return the centroid of the area under a polyline."""
    x, y = curve
    width, left, right = np.diff(x), y[:-1], y[1:]
    area = (width * (left + right) / 2).sum()
    return (width * (x[:-1] * (2 * left + right) + x[1:] * (left + 2 * right)) / 6).sum() / area


@pytest.mark.parametrize("implication", ["min", "prod"])
def test_centroid_of_aggregated_output_matches_inference(implication):
    rng = np.random.default_rng(3)
    rules = [f"if x is S{k} and y is S{4 - k} then u is S{k + 1}" for k in (1, 2, 3)]
    inference = Inference(system(rules, 2, implication=implication))
    assert inference.options.centroid == "exact"
    for x in rng.uniform(0, 1, (20, 2)).tolist():
        (joined,) = aggregated_outputs(inference, *x)
        assert centroid(joined.upper) == pytest.approx(inference(*x)[0], abs=1e-12)
        assert (joined.lower == joined.upper).all()


@pytest.mark.parametrize("aggregation", ["max", "sum", "probor"])
def test_centroid_of_sampled_output_matches_inference(aggregation):
    rules = [f"if x is S{k} then u is S{k + 1}" for k in (1, 2, 3)]
    sampled = system(rules, 1, aggregation=aggregation)
    inference = Inference(sampled, centroid="matlab", samples=201)
    (joined,) = aggregated_outputs(inference, 0.3)
    at, degrees = joined.upper
    assert (at * degrees).sum() / degrees.sum() == pytest.approx(inference(0.3)[0], abs=1e-12)


def test_aggregated_output_is_maximum_of_consequents():
    inference = Inference(PAPER.with_footprint(FOOTPRINT))
    at = np.linspace(-0.1, 0.1, 501)
    for o, joined in enumerate(aggregated_outputs(inference, 0.3, -0.1)):
        cuts = [
            implied_consequent(inference, o, each, at) for each in inference.fired_rules(0.3, -0.1)
        ]
        for bound, curve in enumerate(joined):
            most = np.max([cut[bound] for cut in cuts], axis=0)
            assert np.interp(at, *curve) == pytest.approx(most, abs=1e-9)
        assert (np.interp(at, *joined.lower) <= np.interp(at, *joined.upper) + 1e-12).all()


def test_aggregated_output_without_fired_rules_is_zero():
    sets = (FuzzySet("low", Membership("trimf", (0, 0.1, 0.2))),)
    rules = (parse_rule("if x is low then u is S1"),)
    output = OutputVariable("u", 0, 1, parts(3))
    inference = Inference(FuzzySystem("gap", (InputVariable("x", 0, 1, sets),), (output,), rules))
    (joined,) = aggregated_outputs(inference, 0.5)
    assert not joined.upper[1].any()
    assert rule_viewer(inference, [0.5]).axes


def grid(count):
    """Return a system of two inputs with a rule for each pair of ``count`` sets."""
    inputs = tuple(InputVariable(name, 0, 1, parts(count)) for name in "xy")
    rules = tuple(
        parse_rule(f"if x is S{i + 1} and y is S{j + 1} then u is S{(i + j) % 4 + 1}")
        for i in range(count)
        for j in range(count)
    )
    return FuzzySystem("grid", inputs, (OutputVariable("u", -1, 1, parts(4, -1, 1)),), rules)


def labels_of_rules(figure):
    """Return number and strength of each row of a rule viewer."""
    labels = (each.get_ylabel().removeprefix("rule ").split() for each in figure.axes)
    return [(int(each[0]), float(each[1])) for each in labels if each]


@pytest.mark.parametrize("count", [3, pytest.param(5, marks=pytest.mark.long)])
def test_rule_viewer_shows_all_rules_in_their_order(count, tmp_path):
    inference = Inference(grid(count))
    figure = rule_viewer(inference, [0.1, 0.8])
    strengths = dict.fromkeys(range(1, count**2 + 1), 0.0)
    strengths |= {each.number: each.upper for each in inference.fired_rules(0.1, 0.8)}
    found = labels_of_rules(figure)
    assert [number for number, _ in found] == list(strengths)
    assert [value for _, value in found] == pytest.approx(list(strengths.values()), abs=1e-3)
    assert figure.get_size_inches()[1] <= 12.1
    check(figure, tmp_path / "rules.png")


def test_rule_viewer_of_many_rules_shows_the_strongest_and_states_it():
    inference = Inference(grid(6))
    figure = rule_viewer(inference, [0.1, 0.8])
    fired = inference.fired_rules(0.1, 0.8)
    assert [number for number, _ in labels_of_rules(figure)] == [each.number for each in fired]
    notes = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert f"the {len(fired)} that fire\nof 36 rules, strongest first" in notes
    wide = InputVariable("x", 0, 1, tuple(replace(s, upper=WIDE) for s in parts(30)))
    rules = tuple(parse_rule(f"if x is S{k} then u is S1") for k in range(1, 31))
    many = Inference(FuzzySystem("many", (wide,), grid(2).outputs, rules))
    figure = rule_viewer(many, [0.5])
    assert len(labels_of_rules(figure)) == 25
    assert figure.get_size_inches()[1] <= 12.1
    notes = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "the 25 strongest of 30 that fire\nof 30 rules, strongest first" in notes


def test_names_of_sets_in_the_rule_viewer_stand_above_the_curves():
    sets = (FuzzySet("low", Membership("trapmf", (-1, 0, 0.2, 0.5))),)
    rules = (parse_rule("if x is low then u is S1"),)
    output = OutputVariable("u", 0, 1, parts(3))
    inference = Inference(FuzzySystem("low", (InputVariable("x", 0, 1, sets),), (output,), rules))
    figure = rule_viewer(inference, [0.1])
    figure.canvas.draw()
    for axes in figure.axes[:2]:
        (name,) = axes.texts
        lowest = axes.transData.inverted().transform(name.get_window_extent())[0, 1]
        assert lowest > 1.0


def test_linear_functions_are_drawn_with_the_names_of_the_inputs():
    functions = (LinearFunction("f", 0.1, (0.5, -2.0)), LinearFunction("g", 0.0, (0.0, 1.0)))
    output = OutputVariable("u", -1, 1, functions, defuzzifier="wtaver")
    (axes,) = membership_figure(output, inputs=("error", "rate")).axes
    assert axes.get_xlabel() == "u\nf = 0.1 + 0.5 error − 2 rate\ng = 1 rate"
    assert "0.5 x1" in membership_figure(output).axes[0].get_xlabel()


def check(figure, path):
    """Check that the figure can be saved without a warning and is not clipped at its edges."""
    save(figure, path)
    with Image.open(path) as image:
        grey = np.asarray(image.convert("L"))
    assert grey.std() > 5.0
    edge = np.concatenate([grey[:2].ravel(), grey[-2:].ravel(), grey[:, :2].ravel(),
                           grey[:, -2:].ravel()])  # fmt: skip
    assert edge.min() == 255


@pytest.mark.parametrize("rules", [2, pytest.param(None, marks=pytest.mark.long)])
@pytest.mark.parametrize("type_", [1, 2, 3])
def test_figures_of_the_papers_system(tmp_path, type_, rules):
    """With its first rules; with all of them, a figure has 100 panels."""
    drawn = replace(PAPER, rules=PAPER.rules[:rules])
    if type_ > 1:
        secondary = Secondary(1.0, 0.8, 0.1) if type_ == 3 else None
        drawn = drawn.with_footprint(FOOTPRINT, secondary=secondary)
    check(membership_figure(drawn.inputs[0], unit="m"), tmp_path / "sets.png")
    check(rule_viewer(Inference(drawn), {"error": 0.3, "derror": -0.1}), tmp_path / "rules.png")


def test_control_surfaces(tmp_path):
    check(control_surface(Inference(PAPER), "ki"), tmp_path / "two.png")
    check(control_surface(Inference(SUGENO.with_footprint(FOOTPRINT))), tmp_path / "one.png")
    figure = control_surface(Inference(MIXED), "u", {"x": 0.25})
    check(figure, tmp_path / "three.png")
    assert figure.get_supxlabel() == "with x = 0.25"
    assert control_surface(Inference(MIXED)).get_supxlabel() == "with z = 0.5"


def test_surface_values_match_inference():
    inference = Inference(MIXED)
    figure = control_surface(inference)
    (mesh,) = [each for each in figure.axes[0].collections if each.get_array() is not None][:1]
    x = np.linspace(0, 1, 101)
    rows = np.column_stack([*(a.ravel() for a in np.meshgrid(x, x)), np.full(101 * 101, 0.5)])
    assert (np.ravel(np.asarray(mesh.get_array())) == inference.batch(rows)[0, :, 0]).all()


@pytest.mark.parametrize("count", [2, 3, 20, 200])
def test_set_names_do_not_overlap(tmp_path, count):
    figure = membership_figure(InputVariable("v", 0, 1, parts(count)))
    check(figure, tmp_path / "sets.png")
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    for k, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[k + 1 :])
    assert len(boxes) == (count if count <= 20 else 1)


@pytest.mark.parametrize(
    ("drawn", "reduction"),
    [
        pytest.param(MIXED, "centroid", marks=pytest.mark.long),
        (MIXED.with_footprint(FOOTPRINT), "centroid"),
        (MIXED.with_footprint(FOOTPRINT), "cos"),
        (SUGENO, "centroid"),
        pytest.param(SUGENO, "cos", marks=pytest.mark.long),
    ],
)
def test_rule_viewer_of_mixed_and_sugeno_systems(tmp_path, drawn, reduction):
    check(rule_viewer(Inference(drawn, reduction=reduction)), tmp_path / "rules.png")


def test_names_are_drawn_literally(tmp_path):
    odd = InputVariable(r"$\frac{x", 0, 1, (FuzzySet("$a_b$ 50%", parts(2)[0].upper), *parts(2)))
    check(membership_figure(odd), tmp_path / "odd.png")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the font lacks the glyph
        save(membership_figure(InputVariable("温度", 0, 1, parts(2))), tmp_path / "cjk.png")


def test_invalid_names_are_rejected():
    inference = Inference(PAPER)
    with pytest.raises(InvalidInput, match="no output 'kq'"):
        control_surface(inference, "kq")
    with pytest.raises(InvalidInput, match="no input 'eror'; did you mean 'error'"):
        control_surface(inference, "kp", {"eror": 0.0})
    with pytest.raises(InvalidInput, match="every input is held"):
        control_surface(inference, "kp", {"error": 0.0, "derror": 0.0})
    with pytest.raises(InvalidInput, match="the input 'derror' is missing"):
        rule_viewer(inference, {"error": 0.0})
    with pytest.raises(InvalidInput, match="Sugeno system has no aggregated output"):
        aggregated_outputs(Inference(SUGENO), 0.5)
