"""Rules as text: lossless round trips, limits, and errors with positions."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.position import Position
from omnidrive.fuzzy.rule_text import MAX_LENGTH, normalised, parse_rule, rule_text
from omnidrive.fuzzy.rules import MAX_DEPTH, And, Is, Or, Rule
from tests.examples import examples
from tests.fuzzy.systems import PRINTABLE_NAMES, rules, systems

A, B, C = Is("a", "low"), Is("b", "high", ("not", "very")), Is("c", "mid")
OUT = (Is("out", "big"),)

VARIABLES = st.lists(
    st.tuples(PRINTABLE_NAMES, st.lists(PRINTABLE_NAMES, min_size=1, max_size=3)),
    min_size=1,
    max_size=3,
)
RULES = st.tuples(VARIABLES, VARIABLES).flatmap(lambda known: rules(*known, nesting=4))


@given(RULES)
@examples(80)
def test_round_trip(rule):
    text = rule_text(rule)
    assert parse_rule(text) == rule
    assert rule_text(parse_rule(text)) == text


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("if a is low then out is big", Rule(A, OUT)),
        ("IF a Is low THEN out IS big With 0.5", Rule(A, OUT, 0.5)),
        ("if a is low then out is big (0.5)", Rule(A, OUT, 0.5)),
        ("if\ta is low\r\n  then out is big\n", Rule(A, OUT)),
        ("if 'a' is 'low' then out is big", Rule(A, OUT)),
        ("if a is low and b is NOT very high then out is big", Rule(And((A, B)), OUT)),
        (
            "if a is low or b is not very high and c is mid then out is big",
            Rule(Or((A, And((B, C)))), OUT),
        ),
        (
            "if (a is low or b is not very high) and c is mid then out is big",
            Rule(And((Or((A, B)), C)), OUT),
        ),
        ("if a is low and (b is not very high and c is mid) then out is big",
         Rule(And((A, B, C)), OUT)),
        ("if not a is low then out is big", Rule(Is("a", "low", ("not",)), OUT)),
        ("if not (not (a is very low)) then out is big",
         Rule(Is("a", "low", ("not", "not", "very")), OUT)),
        ("if a is any then out is big", Rule(Is("a", "", ("any",)), OUT)),
        ("if a is not any or c is mid then out is big",
         Rule(Or((Is("a", "", ("not", "any")), C)), OUT)),
        ("if a is low then out is big and p is q, r is not s with 1e-3",
         Rule(A, (*OUT, Is("p", "q"), Is("r", "s", ("not",))), 1e-3)),
        ("if a.b is x-1 then out is +5%", Rule(Is("a.b", "x-1"), (Is("out", "+5%"),))),
        ("if 'it''s hot' is 'very' then out is big", Rule(Is("it's hot", "very"), OUT)),
    ],
)  # fmt: skip
def test_grammar(text, rule):
    assert parse_rule(text) == rule


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        (Rule(And((A,)), OUT), "if a is low then out is big"),
        (Rule(And((A, And((C, A)))), OUT), "if a is low and c is mid and a is low then out is big"),
        (Rule(Or((And((A, C)), A)), OUT), "if a is low and c is mid or a is low then out is big"),
        (Rule(And((Or((A, C)), A)), OUT), "if (a is low or c is mid) and a is low then out is big"),
        (Rule(Is("a b", "IS"), OUT, 0.25), "if 'a b' is 'IS' then out is big with 0.25"),
    ],
)
def test_text_has_only_necessary_parentheses(rule, text):
    assert rule_text(rule) == text
    assert parse_rule(text).antecedent == normalised(rule.antecedent)


@pytest.mark.parametrize(
    ("text", "column", "expected"),
    [
        ("", 1, "expected 'if', got the end"),
        ("when a is b", 1, "expected 'if', got 'when'"),
        ("if", 3, "expected the name of an input, got the end"),
        ("if a iz b then c is d", 6, "expected 'is' after 'a', got 'iz'"),
        ("if a is then c is d", 9, "expected the name of a set of 'a', got 'then'; quote a name"),
        ("if a is any b then c is d", 13, "expected no set after 'any', got 'b'"),
        ("if a is b c is d", 11, "expected 'and', 'or' or 'then', got 'c'"),
        ("if (a is b then c is d", 12, "expected 'and', 'or' or ')', got 'then'"),
        ("if a is b then c is d or e is f", 23, "expected 'and', 'with' or the end of the rule"),
        ("if a is b then c is d with", 27, "expected a weight, got the end"),
        ("if a is b then c is d with 2", 28, "must lie in [0, 1], got 2"),
        ("if a is b then c is d with nan", 28, "expected a number, got 'nan'"),
        ("if a is b then c is d (1", 25, "expected ')', got the end"),
        ("if a is b then c is d with 1 1", 30, "expected the end of the rule, got '1'"),
        ("if a is b then c is d;", 22, "expected a name or keyword, got ';'"),
        ("if a is 'b then c is d", 9, "the quoted name is not closed"),
        ("if a is '' then c is d", 9, "a name has 1 to 200 printable characters, got ''"),
        ("if a is \x07 then c is d", 9, "a name has 1 to 200 printable characters"),
        (f"if a is {'b' * 201} then c is d", 9, "a name has 1 to 200 printable characters"),
        ("if not (a is b or c is d) then e is f", 8, "'not' before a group"),
        (
            f"if {'(' * 60}a is b{')' * 60} then c is d",
            54,
            f"parentheses are nested more than {MAX_DEPTH} deep",
        ),
    ],
)
def test_errors_name_position_and_cause(text, column, expected):
    with pytest.raises(InvalidInput) as caught:
        parse_rule(text, Position(7, 1))
    assert str(caught.value).startswith(f"line 7, column {column}: ")
    assert expected in str(caught.value)


def test_error_position_on_later_line():
    with pytest.raises(InvalidInput, match=r"^line 4, column 9: expected 'is' after 'c', got 'iz'"):
        parse_rule("if a is b\n then c iz d", Position(3, 20))


def test_limits():
    with pytest.raises(InvalidInput, match=f"at most {MAX_LENGTH} characters"):
        parse_rule("if " + "(" * 100_000)
    with pytest.raises(InvalidInput, match="nested more than"):
        parse_rule(f"if {'a is b and (c is d or a is b and (' * 20}a is b{'))' * 20} then c is d")
    deep = A
    for _ in range(5000):
        deep = And((deep, A))
    with pytest.raises(InvalidInput, match="nested more than"):
        rule_text(Rule(deep, OUT))
    with pytest.raises(InvalidInput, match="characters, more than"):
        rule_text(Rule(And((A,) * 2000), OUT))
    deep = A
    for k in range(MAX_DEPTH):
        deep = (Or if k % 2 else And)((deep, C))
    assert parse_rule(rule_text(Rule(deep, OUT))) == Rule(deep, OUT)


TOKENS = ["if", "then", "is", "and", "or", "not", "any", "very", "with", "(", ")", ",", "'", "a",
         "out", "low", "0.5", "nan", "1e999", ":", ";", '"', "\n", "\x00", "''", "é"]  # fmt: skip


@given(st.text() | st.lists(st.sampled_from(TOKENS), max_size=40).map(" ".join))
@example("if a is b then c is d with 1_0")
@examples(300)
def test_arbitrary_text_is_read_or_refused(text):
    try:
        rule = parse_rule(text)
    except InvalidInput:
        pass
    else:
        assert parse_rule(rule_text(rule)) == rule


@given(systems())
@examples(25)
def test_rules_of_systems_round_trip(system):
    for rule in system.rules:
        assert parse_rule(rule_text(rule)) == rule
