"""`omnidrive plan --time-limit`."""

import json

import pytest

from tests.scenario.doors import write_door


def test_status_is_shown_with_a_limit(command, tmp_path):
    write_door(tmp_path)
    status, output, _ = command("plan", "door.yaml", "--time-limit", "600")
    assert status == 0
    assert f"{'status':<20}complete" in output
    assert f"{'status':<20}" not in command("plan", "door.yaml")[1]
    write_door(tmp_path, door=1.2)
    assert (
        json.loads(command("plan", "door.yaml", "--time-limit", "600", "--json")[1])["status"]
        == "complete"
    )


def test_no_path_in_time_is_one_message(command, tmp_path):
    write_door(tmp_path)
    status, _, message = command("plan", "door.yaml", "--time-limit", "1e-9")
    assert status == 2
    assert "within the time limit" in message


def test_limit_of_the_optimisation(command, tmp_path):
    write_door(tmp_path, door=1.2)
    options = "--timing", "minimum-time", "--time-limit", "600"
    status, output, _ = command("plan", "door.yaml", *options)
    assert status == 0
    assert f"{'note':<20}converged: " in output


@pytest.mark.parametrize("value", ["0", "-1", "nan", "soon"])
def test_bad_limits(command, tmp_path, value):
    write_door(tmp_path)
    status, _, message = command("plan", "door.yaml", f"--time-limit={value}")
    assert status == 2
    assert "time limit must be positive" in message or "time-limit" in message
    assert "Traceback" not in message


def test_other_references_have_no_limit(command):
    status, _, message = command("plan", "--reference", "circle", "--time-limit", "1")
    assert status == 2
    assert "planned paths only" in message


def test_help_states_the_unit(command):
    status, output, _ = command("plan", "--help")
    assert status == 0
    assert "--time-limit" in output
