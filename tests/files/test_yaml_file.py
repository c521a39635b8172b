"""YAML of users: plain values only, and one sentence with the line for all else."""

import pytest

from omnidrive.files.yaml_file import parse_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a: 2024-01-01", {"a": "2024-01-01"}),
        ("a: 2024-01-01 10:00:00", {"a": "2024-01-01 10:00:00"}),
        ("a: 1:30", {"a": "1:30"}),
        ("a: 010", {"a": "010"}),
        ("a: 0x10", {"a": "0x10"}),
        ("a: =", {"a": "="}),
        ("<<: {b: 1}\nb: 2", {"<<": {"b": 1}, "b": 2}),
        ("a: [yes, ~, 1.5, 3]", {"a": [True, None, 1.5, 3]}),
    ],
)
def test_values_are_plain(text, value):
    assert parse_yaml(text, "file.yaml", "scenario", ValueError) == value


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("a: !!binary aGk=", "tags (!name) are not allowed"),
        ("a: !!set {x}", "tags (!name) are not allowed"),
        ("a: !!timestamp 2024-01-01", "tags (!name) are not allowed"),
        ("a: !!python/object/apply:os.system [ls]", "tags (!name) are not allowed"),
        ("a: &x [1]\nb: *x", "aliases (*name) are not allowed"),
        ("a: 1\na: 2", "found the key 'a' twice"),
        ("a: " + "9" * 400, "found an integer beyond 1.8e308"),
        ("a: " + "9" * 5000, "found an integer beyond 1.8e308"),
        ("[" * 40 + "]" * 40, "it is nested more than 30 deep"),
        ("[" * 20_000, "it is nested more than 30 deep"),
        ("? [1]\n: 2", "found unhashable key"),
    ],
)
def test_other_yaml_is_refused_in_one_line(text, fact):
    with pytest.raises(ValueError, match=r"\Afile.yaml is not a YAML scenario: .*line \d") as error:
        parse_yaml(text, "file.yaml", "scenario", ValueError)
    assert fact in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300
