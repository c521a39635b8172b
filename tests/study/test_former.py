"""Former names, keys and sections of scenarios load with a note of the present ones."""

from pathlib import Path

import pytest

from omnidrive.errors import InvalidScenario
from omnidrive.study import load_scenario, paper_scenario
from omnidrive.study.scenario_file import parse_scenario, scenario_data
from omnidrive.study.section import Renamed

OLD = {
    "plant": ("ball", "mujoco-balls"),
    "controllers": (["nmpc", "recommended"], ("unicycle-nmpc", "holonomic-nmpc")),
}


@pytest.mark.parametrize("key", OLD)
def test_former_names_load_with_a_warning(key):
    former, present = OLD[key]
    data = scenario_data(paper_scenario()) | {key: former}
    with pytest.warns(
        Renamed, match=r"is now called '(mujoco-balls|unicycle-nmpc|holonomic-nmpc)'"
    ) as notes:
        scenario = parse_scenario(data, "old.yaml")
    found = getattr(scenario, key)
    assert (found.type if key == "plant" else tuple(found)) == present
    assert len(notes) == (2 if key == "controllers" else 1)


def test_former_keys_load_with_a_warning():
    data = scenario_data(paper_scenario())
    data["controllers"] = ["recommended"]
    data["recommended"] = {"traction": 0.5}
    data["robot"]["assumed_arm"] = data["robot"].pop("assumed_effective_radius")
    with pytest.warns(Renamed, match="recommended|assumed_arm"):
        scenario = parse_scenario(data, "old.yaml")
    assert scenario.controllers["holonomic-nmpc"].parameters.traction == 0.5
    data["robot"]["assumed_effective_radius"] = None
    data["controllers"] = ["pid"]
    with pytest.raises(InvalidScenario, match="holds 'assumed_effective_radius' and its former"):
        parse_scenario(data, "old.yaml")


def test_scenario_of_an_earlier_version_loads():
    path = Path(__file__).parent / "data" / "scenario-0.1.0.yaml"
    with pytest.warns(Renamed) as notes:
        scenario = load_scenario(path)
    former, today = scenario.model_dump(), paper_scenario("recommended").model_dump()
    parameters = today["controllers"]["holonomic-nmpc"]["parameters"]
    assert parameters["traction"] == 0.8
    parameters["traction"] = today["timing"]["traction"] = 0.85  # as in the file: former defaults
    assert former == today
    assert {str(note.message) for note in notes} == {
        "'rollers' is now called 'mujoco-rollers'",
        "'nmpc' is now called 'unicycle-nmpc'",
        "'recommended' is now called 'holonomic-nmpc'",
        "'assumed_arm' is now called 'assumed_effective_radius'",
        *(
            f"the values of '{section}' belong to what they configure; write controllers: "
            f"{{{name}: {{type: {name}, ...}}}}"
            for section, name in [
                ("nmpc", "unicycle-nmpc"),
                ("nmpc", "holonomic-nmpc"),
                ("feedforward", "feedforward"),
                ("recommended", "holonomic-nmpc"),
            ]
        ),
    }
