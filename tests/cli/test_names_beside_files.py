"""Names of built-in objects in a folder whose files and folders have the same names."""

import pytest

from omnidrive.cli.scenario_options import ScenarioOptions
from omnidrive.components import component_names
from omnidrive.errors import InvalidInput
from omnidrive.maps import load_map
from omnidrive.robot import named_robot
from omnidrive.study import load_definition
from omnidrive.study.design.definition_file import study_names

GROUPS = ("controllers", "maps", "plants", "references", "robots")


@pytest.fixture(params=["folder", "file"])
def crowded(request, tmp_path, monkeypatch):
    """Working folder with a folder or a file for every built-in name."""
    monkeypatch.chdir(tmp_path)
    names = {name for group in GROUPS for name in component_names(group)}
    for name in {*names, *study_names(), "paper", "published-code", "recommended"}:
        if not name.startswith("."):
            (tmp_path / name).mkdir() if request.param == "folder" else (tmp_path / name).touch()


@pytest.mark.usefixtures("crowded")
def test_names_are_not_hidden():
    assert all(load_definition(name).name.startswith(name) for name in study_names())
    assert all(named_robot(name) for name in component_names("robots"))
    assert all(load_map(n) for n in component_names("maps") if not n.startswith("."))


@pytest.mark.usefixtures("crowded")
def test_options_take_names_before_files():
    assert (
        ScenarioOptions(robot="small").resolve()
        == ScenarioOptions("paper", robot="small").resolve()
    )
    moved = ScenarioOptions(reference="circle", plant="kinematic", robot="kiwi").resolve()
    assert (moved.reference.type, moved.plant.type) == ("circle", "kinematic")


@pytest.mark.usefixtures("crowded")
def test_path_of_a_file_that_has_the_name_of_a_study():
    with pytest.raises(InvalidInput, match=r"paper"):
        load_definition("./paper")
