"""Ends of messages about unknown names."""

from omnidrive.errors import suggestion


def test_suggestion_is_the_closest_name_or_a_list():
    assert suggestion("colour", ["size", "color"]) == "; did you mean 'color'?"
    assert suggestion("x", ["ab", "cd", "ef"], most=2) == "; there are ab, cd, ..."


def test_names_of_a_file_are_shown_as_one_short_line():
    assert suggestion("x", ["a\nb", "c" * 5000]) == f"; there are a\\nb, {'c' * 57}..."
    assert suggestion("c" * 4990, ["c" * 5000]) == f"; did you mean '{'c' * 57}...'?"
