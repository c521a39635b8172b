"""`omnidrive plan` with the outline of a robot."""

import json

import pytest

from tests.scenario.doors import write_door


@pytest.mark.parametrize(
    ("outline", "fault"),
    [
        ([[0.2, 0.2], [-0.2, -0.2], [-0.2, 0.2], [0.2, -0.2]], "not a simple polygon"),
        ([[0.2, 0.2], [-0.2, -0.2]], "at least three corners"),
        ([[0.3, 0.1], [0.1, 0.1], [0.1, 0.2]], "contain the origin"),
        ("0.3 0.2", "robot.outline needs corners such as"),
        ([[0.3, float("nan")], [0.1, 0.1], [0.1, 0.2]], "outline"),
    ],
)
def test_faults_are_one_message(command, tmp_path, outline, fault):
    write_door(tmp_path, outline=outline)
    status, _, message = command("plan", "door.yaml")
    assert status == 2
    assert fault in message
    assert "Traceback" not in message


def test_command_says_which_shape_was_needed(command, tmp_path):
    write_door(tmp_path)
    status, output, _ = command("plan", "door.yaml", "--png", "door.png")
    assert status == 0
    assert f"{'shape':<20}polygon" in output
    assert "no path for the disc" in output
    write_door(tmp_path, door=1.2)
    assert json.loads(command("plan", "door.yaml", "--json")[1])["shape"] == "disc"
