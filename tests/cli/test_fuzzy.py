"""Command `omnidrive fuzzy`."""

import json
import logging
import os
import re
import sys
from contextlib import contextmanager

import numpy as np
import pytest

from omnidrive.cli.fuzzy_systems.fuzzy import fuzzy as app
from omnidrive.fuzzy import (
    Footprint,
    FuzzySet,
    FuzzySystem,
    Inference,
    InputVariable,
    LinearFunction,
    Membership,
    OutputVariable,
    load,
    parse_rule,
    save,
)
from omnidrive.fuzzy.csv_rows import evaluate_csv
from tests.command import omnidrive
from tests.shared_data import shared


def thirds(low, high):
    """Three triangles that cover a range."""
    width = 0.5 * (high - low)
    peaks = ((name, low + k * width) for k, name in enumerate(("low", "middle", "high")))
    return tuple(
        FuzzySet(name, Membership("trimf", (at - width, at, at + width))) for name, at in peaks
    )


RULES = (
    "if service is low or food is low then tip is low",
    "if service is middle then tip is middle and 'slow, ok' is high",
    "if service is high and food is not low then tip is high with 0.9",
)
TIPPER = FuzzySystem(
    "tipper",
    (InputVariable("service", 0, 10, thirds(0, 10)), InputVariable("food", 0, 10, thirds(0, 10))),
    (OutputVariable("tip", 0, 30, thirds(0, 30)), OutputVariable("slow, ok", 0, 1, thirds(0, 1))),
    tuple(map(parse_rule, RULES)),
)
SUGENO = FuzzySystem(
    "linear",
    (InputVariable("x", 0, 1, thirds(0, 1)),),
    (OutputVariable("y", 0, 1, (LinearFunction("a", 0.25), LinearFunction("b", 0.5, (2.0,)))),),
    tuple(map(parse_rule, ("if x is low then y is a", "if x is middle then y is b"))),
)


@pytest.fixture(scope="module", autouse=True)
def _kernels():
    """Compile the kernels before the first test, so that no test prints the notice."""
    Inference(TIPPER).batch(np.zeros((1, 2)))


@pytest.fixture
def fuzzy(monkeypatch, capsys, tmp_path):
    """Run the command in this process; return status, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    save(TIPPER, "tipper.fis")
    save(SUGENO, "linear.fis")

    def run(*args):
        try:
            status = app([*map(str, args)], prog_name="omnidrive fuzzy", standalone_mode=False)
        except Exception as error:
            status = sys.modules["omnidrive.cli.main"]._handle(error)
        printed = capsys.readouterr()
        return int(status or 0), printed.out, printed.err

    return run


def table(path):
    return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)


def write(text, name="in.csv"):
    with open(name, "w", encoding="utf-8", newline="") as stream:
        stream.write(text)


def test_installed_command(tmp_path):
    done = omnidrive("fuzzy", "show", "no.fis", cwd=tmp_path)
    assert done.returncode == 2
    assert "cannot read the fuzzy system no.fis: No such file" in done.stderr
    assert "Traceback" not in done.stderr


def test_show_describes_variables_sets_and_rules(fuzzy):
    status, out, err = fuzzy("show", "tipper.fis")
    assert (status, err) == (0, "")
    assert "tipper: Mamdani, type 1; 2 inputs, 2 outputs, 3 rules" in out
    assert "and = min, or = max, implication = min" in out
    assert "input service in [0, 10]" in out
    assert "  middle  trimf [0 5 10]" in out
    assert "3  if service is high and food is not low then tip is high with 0.9" in out


def test_compilation_is_announced(fuzzy, monkeypatch, caplog):
    @contextmanager
    def announce():
        logging.getLogger("omnidrive").warning("compiling")
        yield

    monkeypatch.setattr("omnidrive.cli.fuzzy_systems.fuzzy_actions.announce_compiling", announce)
    fuzzy("show", "tipper.fis")
    assert not caplog.records
    fuzzy("show", "tipper.fis", "--inputs", "3,8")
    assert [record.message for record in caplog.records] == ["compiling"]


def test_show_as_json_with_outputs_and_rules_that_fire(fuzzy):
    status, out, _ = fuzzy("show", "tipper.fis", "--inputs", "3,8", "--json")
    data = json.loads(out)
    assert (status, data["name"], data["kind"], data["type"]) == (0, "tipper", "Mamdani", 1)
    assert [each["name"] for each in data["inputs"]] == ["service", "food"]
    assert data["outputs"][0]["sets"] == [each.name for each in thirds(0, 30)]
    assert data["results"]["tip"]["value"] == Inference(TIPPER)(3, 8)[0]
    assert {each["rule"] for each in data["fired"]} <= {1, 2, 3}
    assert "results" not in json.loads(fuzzy("show", "tipper.fis", "--json")[1])


def test_show_sugeno_system(fuzzy):
    status, out, _ = fuzzy("show", "linear.fis", "--inputs", "x=0.25")
    assert status == 0
    assert "linear: Sugeno, type 1; 1 input, 1 output, 2 rules" in out
    assert "b  0.5 + 2 x" in out
    assert repr(Inference(SUGENO)({"x": 0.25})["y"]) in out


def test_show_outputs_for_given_inputs(fuzzy):
    status, out, err = fuzzy("show", "tipper.fis", "--inputs", "food=8, service=12")
    assert status == 0
    assert "service = 12 is out of range: clamped to 10" in err
    assert re.search(r"^3  0\.9000  if service is high", out, re.MULTILINE)
    assert repr(float(Inference(TIPPER)(10, 8)[0])) in out
    assert fuzzy("show", "tipper.fis", "--inputs", "12,8")[1] == out


def test_show_evaluates_as_the_options_say_and_states_how(fuzzy):
    exact = fuzzy("show", "tipper.fis", "--inputs", "3,8")[1]
    assert "closed form; --centroid matlab: of 101 samples, as in Matlab" in exact
    for options, samples in (((), 101), (("--samples", 21), 21)):
        status, out, _ = fuzzy(
            "show", "tipper.fis", "--inputs", "3,8", "--centroid", "matlab", *options
        )
        expected = Inference(TIPPER, centroid="matlab", samples=samples)(3, 8)[0]
        assert status == 0
        assert f"of {samples} samples, as in Matlab" in out
        assert repr(float(expected)) in out
        assert repr(float(expected)) not in exact
    assert fuzzy("show", "tipper.fis", "--samples", 21)[0] == 2
    assert fuzzy("show", "tipper.fis", "--algorithm", "ekm")[0] == 2
    out = fuzzy(
        "show", "tipper.fis", "--type2", "0.8,0.2", "--inputs", "3,8", "--reduction", "cos"
    )[1]
    assert "centre of sets" in out


def test_show_type_2_system_with_intervals(fuzzy):
    status, out, _ = fuzzy("show", "tipper.fis", "--type2", "0.8,0.1,0.3", "--inputs", "3,8")
    assert status == 0
    assert "interval type 2" in out
    assert "trimf [0 5 10], lower: scale 0.8, lag 0.1 left, 0.3 right" in out
    least, greatest = Inference(TIPPER.with_footprint(Footprint(0.8, 0.1, 0.3))).interval(3, 8)
    assert repr(float(least[0])) in out
    assert repr(float(greatest[0])) in out


def test_show_paper_rules_as_table(fuzzy):
    status, out, _ = fuzzy("show", shared("paper/IT1FUZZY.fis"))
    assert status == 0
    assert "Rules: kp/ki/kd, for each error (down) and derror (across)" in out
    row = next(line for line in out.splitlines() if line.startswith("│ HM"))
    assert [cell.strip() for cell in row.strip("│").split("│")][:3] == [
        "HM",
        "HS/ZO/HB",
        "ZO/ZO/LS",
    ]


def test_show_limits_its_output(fuzzy, tmp_path):
    many = tuple(
        parse_rule(f"if service is low then tip is low with {k / 999}") for k in range(999)
    )
    save(FuzzySystem("big", TIPPER.inputs, TIPPER.outputs, many), tmp_path / "big.fis")
    status, out, _ = fuzzy("show", "big.fis", "--inputs", "1,1")
    assert status == 0
    assert "... and 939 more rules" in out
    assert "... and 978 more rules" in out
    assert len(out.splitlines()) < 150


def test_show_warns_of_gaps(fuzzy, tmp_path):
    sets = (FuzzySet("low", Membership("trimf", (0, 1, 2))),)
    gappy = InputVariable("service", 0, 10, sets)
    rules = (parse_rule("if service is low then tip is low"),)
    save(FuzzySystem("gappy", (gappy,), TIPPER.outputs, rules), tmp_path / "gappy.fis")
    status, _, err = fuzzy("show", "gappy.fis")
    assert status == 0
    assert "no set of 'service' covers" in err


def test_show_saves_figures_in_new_folder(fuzzy, tmp_path):
    status, out, err = fuzzy("show", "tipper.fis", "--inputs", "3,8", "--out", "a/figures")
    assert (status, err) == (0, "")
    assert "7 figures written to a/figures" in out
    assert sorted(path.name for path in (tmp_path / "a/figures").iterdir()) == [
        "rules.png", "sets-1-service.png", "sets-2-food.png", "sets-3-tip.png",
        "sets-4-slow-ok.png", "surface-1-tip.png", "surface-2-slow-ok.png",
    ]  # fmt: skip
    assert fuzzy("show", "tipper.fis", "--out", "a/figures")[0] == 2


def test_convert_is_lossless_and_overwrites_only_with_force(fuzzy):
    assert fuzzy("convert", "linear.fis", "linear.fll") == (0, "written to linear.fll\n", "")
    assert load("linear.fll") == load("linear.fis")
    status, out, err = fuzzy("convert", "linear.fis", "linear.fll")
    assert (status, out) == (2, "")
    assert "linear.fll already exists; choose another, or add --force" in err
    assert fuzzy("convert", "linear.fis", "linear.fll", "--force")[0] == 0


def test_convert_to_type_2(fuzzy):
    assert fuzzy("convert", "tipper.fis", "tipper2.fis", "--type2", "0.8,0.2")[0] == 0
    assert load("tipper2.fis").outputs == TIPPER.with_footprint(Footprint(0.8, 0.2)).outputs


def test_eval_matches_columns_by_name_and_is_exact(fuzzy):
    x = np.random.default_rng(0).uniform(-1, 11, (500, 2))
    write("food,t,service\n" + "".join(f"{b!r},now,{a!r}\n" for a, b in x.tolist()))
    status, out, err = fuzzy("eval", "tipper.fis", "--in", "in.csv", "--out", "out.csv")
    assert (status, out) == (0, "500 rows written to out.csv\n")
    assert "columns ignored, because they are not inputs: t" in err
    with open("out.csv", encoding="utf-8") as stream:
        assert stream.readline() == 'tip,"slow, ok"\n'
    assert (table("out.csv") == Inference(TIPPER).batch(x)[0]).all()


def test_eval_states_once_how_many_rows_are_out_of_range(fuzzy):
    write("service,food\n3,8\n12,8\n-1,11\n0,10\n")
    args = ["eval", "tipper.fis", "--in", "in.csv", "--out", "out.csv", "--force"]
    status, _, err = fuzzy(*args)
    assert status == 0
    assert err.count("out of its range") == 1
    assert "2 of 4 rows have an input out of its range: clamped to the range" in err
    unchanged = fuzzy(*args, "--out-of-range", "matlab")[2]
    assert "2 of 4 rows have an input out of its range: used unchanged" in unchanged
    write("service,food\n3,8\n0,10\n")
    assert "out of its range" not in fuzzy(*args)[2]


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ("--centroid matlab --samples 51", {"centroid": "matlab", "samples": 51}),
        ("--reduction cos --algorithm eiasc", {"reduction": "cos", "algorithm": "eiasc"}),
        ("--algorithm nie-tan --threads 2", {"algorithm": "nie-tan"}),
        ("--out-of-range matlab", {"out_of_range": "matlab"}),
    ],
)
def test_eval_of_type_2_with_options(fuzzy, arguments, options):
    x = np.random.default_rng(1).uniform(-1, 11, (50, 2))
    write("service,food\n" + "".join(f"{a!r},{b!r}\n" for a, b in x.tolist()))
    args = ["--in", "in.csv", "--out", "out.csv", "--type2", "0.8,0.2", *arguments.split()]
    assert fuzzy("eval", "tipper.fis", *args)[0] == 0
    with open("out.csv", encoding="utf-8") as stream:
        assert stream.readline().startswith("tip,tip_lower,tip_upper,")
    found = Inference(TIPPER.with_footprint(Footprint(0.8, 0.2)), **options).batch(x)
    assert (table("out.csv").reshape(50, 2, 3) == found.transpose(1, 2, 0)).all()


def test_eval_sugeno_system_with_type_2_inputs(fuzzy):
    write("x\n0.3\n")
    args = ["--in", "in.csv", "--out", "out.csv", "--type2", "0.8,0.2"]
    assert fuzzy("eval", "linear.fis", *args)[0] == 0
    value, lower, upper = table("out.csv")[0]
    assert lower < value < upper


@pytest.mark.parametrize(
    "text",
    [
        "\ufeffservice,food\r\n\r\n1,2\r\n 3.5 ,+4\r\n\r\n",
        'food,"service",note\n2,1,"a, b"\n"4","3.5",\n',
        "service , food\n1.,2\n3.5e0,.4E1",
        "service;food\n1;2\n\n3,5;4,0\n",
        "\ufeff# service\tfood\r\n1\t2\r\n3.5\t4\r\n",
        "# by night\n# service; food; note\n1; 2; \n# a comment\n3,5; 4; \n",
        " food   service\n 2  1\n 4  3.5\n",
        ",service,food\n0,1,2\n1,3.5,4\n",
        '"Unnamed: 0";"service";"food"\n"0";"1";"2"\n"1";"3,5";"4"\n',
    ],
)
def test_eval_reads_csv_variants(fuzzy, text):
    write(text)
    assert fuzzy("eval", "tipper.fis", "--in", "in.csv", "--out", "out.csv")[0] == 0
    assert (table("out.csv") == Inference(TIPPER).batch(np.array([[1, 2], [3.5, 4]]))[0]).all()


def test_eval_notes_no_index_and_reads_comments_in_any_block(fuzzy, monkeypatch):
    monkeypatch.setattr("omnidrive.fuzzy.csv_rows._BLOCK", 1000)
    rows = np.column_stack([np.linspace(0, 10, 999), np.linspace(10, 0, 999)])
    lines = [f"{i};{a!r};{b!r}".replace(".", ",") for i, (a, b) in enumerate(rows.tolist())]
    write("\n".join([";service;food", *lines[:500], "# comment", *lines[500:]]))
    status, _, err = fuzzy("eval", "tipper.fis", "--in", "in.csv", "--out", "out.csv")
    assert (status, err) == (0, "")
    assert (table("out.csv") == Inference(TIPPER).batch(rows)[0]).all()


def test_eval_without_rows_writes_header(fuzzy):
    write("service,food\n")
    assert fuzzy("eval", "tipper.fis", "--in", "in.csv", "--out", "out.csv")[0] == 0
    with open("out.csv", encoding="utf-8") as stream:
        assert stream.read() == 'tip,"slow, ok"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: expected the columns service, food, got an empty line"),
        ("service\n1\n", "line 1: there is no column 'food'"),
        ("service,foot\n1,2\n", "there is no column 'food'; did you mean 'foot'?"),
        ("# service\nfoot;food\n1;2\n", "line 2: there is no column 'service'"),
        ("1,2\n3,4\n", "line 1: expected the columns service, food, got numbers"),
        ("service;food\n1;2.5.1\n", "column 'food': expected a finite number, got '2.5.1'"),
        ("service;food\n1,5;2\n1,5;two\n", "line 3, column 'food': expected a finite number"),
        ('"service,food\n1,2\n', "the titles: unexpected end of data"),
        ("food,service,food\n1,2,3\n", "line 1: the column 'food' appears twice"),
        ("service,food\n1,2\n\n3\n", "line 4: expected 2 values, as in line 1, got 1"),
        ("service,food\n1,2\n1,2,3\n", "line 3: expected 2 values, as in line 1, got 3"),
        ("service,food\n1,\n", "line 2, column 'food': expected a number, got an empty field"),
        (
            "service,food\n1,2\n1,two\n",
            "line 3, column 'food': expected a finite number, got 'two'",
        ),
        ("service,food\n1,1_0\n", "line 2, column 'food': expected a finite number, got '1_0'"),
        ("service,food\nnan,1\n", "line 2, column 'service': expected a finite number, got 'nan'"),
        ("service,food\n1,1e999\n", "expected a finite number, got '1e999'"),
        ("service,food\n1,__import__('os')\n", "expected a finite number"),
        ('service,food\n1,"2\n3"\n', "line 2: unexpected end of data"),
        ("service,food\n1,2\n1,\0\n", "line 3: expected text, got a NUL character"),
        ("service,food\n1,2\r3,4\n", "line 2: expected 2 values, as in line 1, got 3"),
        ("x" * 2_000_000, "line 1 is longer than 1000000 bytes"),
        ("service,food\n1," + "1" * 2_000_000, "line 2 is longer than 1000000 bytes"),
    ],
)
def test_invalid_table_error_names_position_and_writes_nothing(fuzzy, text, message):
    write(text)
    status, out, err = fuzzy("eval", "tipper.fis", "--in", "in.csv", "--out", "out.csv")
    assert (status, out) == (2, "")
    assert f"in.csv: {message}" in err or message in err
    assert not [name for name in os.listdir() if "out.csv" in name]


def test_policies_that_raise(fuzzy):
    write("service,food\n" + "1,1\n" * 50 + "\n11,1\n")
    args = ("eval", "tipper.fis", "--in", "in.csv", "--out", "out.csv")
    status, _, err = fuzzy(*args, "--out-of-range", "raise")
    assert status == 2
    assert "in.csv: line 53: the input 'service' is 11, outside its range [0, 10]" in err
    status, _, err = fuzzy(*args, "--out-of-range", "matlab", "--no-rule", "raise")
    assert status == 2
    assert "in.csv: line 53: no rule fires for service = 11, food = 1" in err


@pytest.mark.parametrize(
    "arguments",
    [("show", "pipe.fis"), ("eval", "tipper.fis", "--in", "pipe.csv", "--out", "o.csv")],
)
def test_pipe_as_input_is_refused(fuzzy, arguments):
    for name in ("pipe.fis", "pipe.csv"):
        os.mkfifo(name)
    status, _, err = fuzzy(*arguments)
    assert status == 2
    assert "it is not a file but a pipe; save its content to a file first" in err


def test_late_error_keeps_old_output(fuzzy, monkeypatch, tmp_path):
    monkeypatch.setattr("omnidrive.fuzzy.csv_rows._BLOCK", 1000)
    write("old", "out.csv")
    write("service,food\n" + "1.25,2\n" * 5000 + "1,x\n")
    inference = Inference(TIPPER)
    with pytest.raises(ValueError, match="line 5002, column 'food'"):
        evaluate_csv(inference, tmp_path / "in.csv", tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text() == "old"
    write("service,food\n" + "1.25,2\n" * 5000)
    assert evaluate_csv(inference, tmp_path / "in.csv", tmp_path / "out.csv").rows == 5000
    assert (table("out.csv") == inference(1.25, 2)).all()
    assert sorted(os.listdir()) == ["in.csv", "linear.fis", "out.csv", "tipper.fis"]


SHOW, EVAL = ("show", "tipper.fis"), ("eval", "tipper.fis", "--in", "in.csv", "--out")


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("show", "no.fis"), "cannot read the fuzzy system no.fis: No such file"),
        (("show", "in.csv"), "its suffix must be one of .fis, .fll"),
        (("show", "bad.fis"), "bad.fis: line 1, column 1"),
        ((*SHOW, "--type2", "0.8"), "--type2 must be SCALE,LAG or SCALE,LAG,LAG"),
        ((*SHOW, "--type2", "0.8,x"), "such as 0.8,0.2; got '0.8,x'"),
        ((*SHOW, "--type2", "2,0"), "a footprint's scale must lie in [0, 1], got 2"),
        ((*SHOW, "--inputs", "food=1"), "the input 'service' is missing"),
        ((*SHOW, "--inputs", "fod=1"), "no input 'fod'; did you mean 'food'?"),
        ((*SHOW, "--inputs", "food=1,food=2"), "the input 'food' appears twice"),
        ((*SHOW, "--inputs", "1"), "--inputs needs 2 numbers (service, food), got 1"),
        ((*SHOW, "--inputs", "food=1,service=2+3"), "expected a number for 'service', got '2+3'"),
        ((*SHOW, "--inputs", "nan,1"), "expected a number for 'service', got 'nan'"),
        ((*SHOW, "--inputs", "1_0,1"), "expected a number for 'service', got '1_0'"),
        ((*SHOW, "--out", "in.csv"), "cannot write to in.csv"),
        (("convert", "tipper.fis", "a.doc"), "its suffix must be one of"),
        (("convert", "tipper.fis", "a.fll", "--type2", "1,0"), "does not support sets of type 2"),
        (("convert", "tipper.fis", "no/a.fis"), "cannot write to no/a.fis: there is no folder no"),
        ((*EVAL, "in.csv"), "in.csv already exists; choose another, or add --force"),
        ((*EVAL, "/dev/null", "--force"), "/dev/null is not a plain file"),
        ((*EVAL, "no/out.csv"), "cannot write to no/out.csv: there is no folder no"),
        ((*EVAL, "o.csv", "--centroid", "exat"), "no --centroid 'exat'; there are exact, matlab"),
        ((*EVAL, "o.csv", "--samples", "9"), "--samples applies to --centroid matlab"),
        ((*EVAL, "o.csv", "--algorithm", "km"), "--algorithm applies to type-2 systems"),
        ((*EVAL, "o.csv", "--threads", "0"), "threads"),
        (("eval", "tipper.fis", "--in", "no.csv", "--out", "o.csv"), "the inputs no.csv: No"),
        (("eval", "type2.fis", *EVAL[2:], "o.csv", "--type2", "1,0"), "type2.fis is of type 2"),
    ],
)  # fmt: skip
def test_errors_are_one_paragraph_with_status_2(fuzzy, args, message):
    write("service,food\n1,2\n")
    write("nonsense\n", "bad.fis")
    save(TIPPER.with_footprint(Footprint(0.8, 0.2)), "type2.fis")
    before = sorted(os.listdir())
    status, out, err = fuzzy(*args)
    assert status == 2, out + err
    assert message in " ".join(err.split())
    assert out == ""
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize("verb", ["show", "convert", "eval"])
def test_help_has_example(fuzzy, verb):
    status, out, _ = fuzzy(verb, "--help")
    assert status == 0
    assert f"omnidrive fuzzy {verb} tipper.fis" in out
