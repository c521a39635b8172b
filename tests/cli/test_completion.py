"""Completion in bash, zsh and fish, by the protocol of the shells' scripts."""

import pytest

from omnidrive.cli.main import app
from omnidrive.components import component_names


@pytest.fixture
def answer(monkeypatch, capsys, tmp_path):
    """Run the command as the script of a shell does; return the printed lines."""
    monkeypatch.chdir(tmp_path)

    def run(**variables):
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit) as ended:
            app(prog_name="omnidrive", standalone_mode=False)
        assert not ended.value.code
        return capsys.readouterr().out.split("\n")[:-1]

    return run


@pytest.fixture
def bash(answer):
    """Complete the last word of a line in bash."""

    def run(line):
        words = line.split(" ")
        found = answer(
            _OMNIDRIVE_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1)
        )
        return [each for each in found if each]

    return run


@pytest.mark.parametrize(
    ("line", "values"),
    [
        ("omnidrive com", ["compare"]),
        ("omnidrive compare --rob", ["--robot"]),
        ("omnidrive compare --qui", ["--quiet"]),
        ("omnidrive compare --robot ki", ["kiwi"]),
        ("omnidrive compare --plant mujoco-", ["mujoco-balls", "mujoco-rollers"]),
        ("omnidrive compare --controllers pid,uni", ["pid,unicycle-nmpc"]),
        ("omnidrive compare --controllers pid,pi", []),
        ("omnidrive compare --tasks track,no", ["track,noise"]),
        ("omnidrive run --controller holo", ["holonomic-nmpc"]),
        ("omnidrive run --task st", ["step"]),
        ("omnidrive run --fault wheel-d", ["wheel-dead"]),
        ("omnidrive run --preset re", ["recommended"]),
        ("omnidrive run --reference ei", ["eight"]),
        ("omnidrive plan --search jump", ["jump-point"]),
        ("omnidrive plan --heading tan", ["tangent"]),
        ("omnidrive plan --map ", []),  # the shell lists files
        ("omnidrive plan ", []),
        ("omnidrive plan pap", ["paper"]),
        ("omnidrive fuzzy co", ["convert"]),
        ("omnidrive fuzzy eval --centroid ma", ["matlab"]),
        ("omnidrive fuzzy eval --algorithm ei", ["eiasc"]),
        ("omnidrive robot show mec", ["mecanum"]),
        ("omnidrive robot import --format ur", ["urdf"]),
        ("omnidrive list cont", ["controllers"]),
        ("omnidrive new pl", ["plant"]),
        ("omnidrive schema ro", ["robot"]),
    ],
)
def test_bash_completes_verbs_options_and_values(bash, line, values):
    assert bash(line) == values


def test_all_names_of_components_are_completed(bash):
    assert bash("omnidrive run --controller ") == list(component_names("controllers"))


def test_file_has_precedence_over_paper(bash, tmp_path):
    (tmp_path / "paper_map.yaml").touch()
    assert bash("omnidrive plan pap") == []


def test_zsh_completes_with_descriptions(answer):
    line = {"_OMNIDRIVE_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "omnidrive run --task s"}
    assert '"step"' in "".join(answer(**line))
    verbs = answer(_OMNIDRIVE_COMPLETE="complete_zsh", _TYPER_COMPLETE_ARGS="omnidrive sch")
    assert '"schema":"Print the JSON schema' in "".join(verbs)


def test_fish_completes(answer):
    found = answer(
        _OMNIDRIVE_COMPLETE="complete_fish",
        _TYPER_COMPLETE_FISH_ACTION="get-args",
        _TYPER_COMPLETE_ARGS="omnidrive compare --robot s",
    )
    assert found == ["small"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_script_of_a_shell(answer, monkeypatch, shell):
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: shell)
    monkeypatch.setattr("sys.argv", ["omnidrive", "--show-completion"])
    script = "\n".join(answer())
    assert f"_OMNIDRIVE_COMPLETE=complete_{shell}" in script
