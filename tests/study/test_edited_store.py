"""Folders of studies that were edited by hand: one sentence, or the rest with a note."""

import shutil
import sqlite3

import pytest

from omnidrive.errors import OmnidriveError
from omnidrive.study import RunPlan
from omnidrive.study.output_paths import DEFINITION_FILE
from omnidrive.study.storage.store import FILE, Store
from omnidrive.study.stored_study import read_study
from omnidrive.study.study_folder import load_study, note_file, study_outline
from tests.study.test_stored_study import made


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study of 48 runs, and its rows by number."""
    folder = made(tmp_path_factory.mktemp("edited") / "a")
    with Store(folder) as store:
        note_file(store, folder / DEFINITION_FILE, RunPlan(load_study(folder)[0]))
        rows = store.records().to_pylist()
    return folder, {row["number"]: row for row in rows}


LOST = "left out"
KEPT = ""
SQL = {
    # statements, and what readers say: a part of an error, of the note of a loss, or nothing
    "UPDATE runs SET pairing = -1 WHERE number = 3": LOST,
    "UPDATE runs SET number = -number - 1 WHERE number < 4": LOST,
    "UPDATE runs SET number = 1000000 WHERE number = 4": LOST,
    "UPDATE runs SET repetition = repetition + 1": LOST,
    "UPDATE runs SET result = 1": LOST,
    "UPDATE runs SET result = -5 WHERE number = 1": LOST,
    "UPDATE runs SET controller = 'pid'": LOST,
    "UPDATE runs SET factors = '{' WHERE number = 2": LOST,
    "UPDATE runs SET factors = '[]'": LOST,
    "UPDATE runs SET duration = 'nan' WHERE number = 2": LOST,
    "UPDATE runs SET checksum = 0": LOST,
    "UPDATE results SET key = 'x' WHERE id = 2": LOST,
    "UPDATE results SET outcome = 'a' || x'00' WHERE id = 2": LOST,
    "UPDATE results SET finished = 7 WHERE id = 2": LOST,
    "UPDATE results SET names = '[[\"me\"], []]' WHERE id = 2": LOST,
    "UPDATE results SET floats = zeroblob(16) WHERE id = 2": LOST,
    "UPDATE results SET floats = x'' WHERE id = 2": LOST,
    "UPDATE results SET floats = zeroblob(70000000) WHERE id = 2": LOST,
    "UPDATE results SET detail = 'edited' WHERE id = 2": LOST,
    "UPDATE results SET checksum = -checksum WHERE id = 2": KEPT,
    "INSERT INTO runs SELECT 500, result, pairing, controller, task, duration, variant, repetition,"
    " repeat, factors, checksum FROM runs WHERE number = 1": KEPT,
    "DELETE FROM results": LOST,
    "DELETE FROM runs WHERE number > 9": LOST,
    "DELETE FROM facts": "its stop rule are lost",
    "UPDATE facts SET content = '{\"runs\": 3}'": "its stop rule are lost",
    "UPDATE facts SET content = replace(content, '48', '12')": "its stop rule are lost",
    "UPDATE facts SET content = 'no JSON'": "its stop rule are lost",
    "UPDATE facts SET id = 2": "its stop rule are lost",
    "INSERT INTO facts VALUES (2, '', 0)": KEPT,
    "DROP TABLE facts": "its table facts is missing",
    "DROP TABLE runs": "its table runs is missing",
    "DROP TABLE results": "its table results is missing",
    "DROP TABLE leases": KEPT,
    "DROP TABLE processes": KEPT,
    "DROP INDEX leased_keys": KEPT,
    "ALTER TABLE runs ADD COLUMN more TEXT": "its table runs is missing, or has other columns",
    "ALTER TABLE runs DROP COLUMN variant": "its table runs is missing, or has other columns",
    "ALTER TABLE results RENAME COLUMN detail TO details": "its table results is missing, or",
    "ALTER TABLE runs RENAME TO a; CREATE VIEW runs AS SELECT * FROM a": "runs is missing",
    "CREATE TABLE more (a)": KEPT,
    "CREATE TRIGGER t AFTER INSERT ON runs BEGIN DELETE FROM runs; END": KEPT,
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, ' STRICT', '')":
        "has other columns",
    "PRAGMA user_version = 1": "was written by an older version of omnidrive",
    "PRAGMA user_version = 5": "was written by a newer version of omnidrive",
    "PRAGMA application_id = 1": "is a database of another program",
    "PRAGMA journal_mode = DELETE": KEPT,
    "VACUUM": KEPT,
}  # fmt: skip
"""Edits of the database."""


def copied(whole, tmp_path):
    return shutil.copytree(whole[0], tmp_path / "a")


def check_rows(found, rows):
    for row in found:
        assert repr(row) == repr(rows[row["number"]])


def check(folder, rows, expected, caplog):
    """Read an edited study, and open it for writing; no value may be another one."""
    try:
        study = read_study(folder)
    except OmnidriveError as error:
        said = str(error)
    else:
        said = " ".join(record.getMessage() for record in caplog.records)
        assert bool(expected) == bool(study.loss.runs), said
        check_rows(study.table.to_pylist(), rows)
        said = said or "no note"
    assert expected in said
    assert expected or said == "no note"
    assert "\n" not in said
    try:
        store = Store(folder)
    except OmnidriveError:
        return
    with store:
        assert not store.status().loss.runs
        check_rows(store.records().to_pylist(), rows)
        assert len(store.numbers(-(2**62), 2**62)) == store.status().runs == store.count


@pytest.mark.parametrize(("statement", "expected"), SQL.items())
def test_edited_database(whole, tmp_path, caplog, statement, expected):
    folder = copied(whole, tmp_path)
    connection = sqlite3.connect(folder / FILE)
    connection.execute("PRAGMA foreign_keys = OFF")
    connection.executescript(statement)
    connection.close()
    check(folder, whole[1], expected, caplog)


@pytest.mark.parametrize(
    "outline", ["no JSON", "[]", "3", "null", "{}", "[[]]", '["a", 0, true]', '["a", 0, true, "b"]']
)
def test_status_ignores_an_outline_of_another_form(whole, tmp_path, outline):
    folder = copied(whole, tmp_path)
    expected = study_outline(folder)
    with Store(folder) as store:
        store.note("outline", outline)
    assert study_outline(folder) == expected


def other_log(folder):
    """Put the write-ahead log of another study beside the database."""
    other = made(folder / "other", better=0.02)
    connection = sqlite3.connect(other / FILE)
    connection.execute("UPDATE runs SET pairing = 7")
    connection.commit()
    shutil.copy(other / f"{FILE}-wal", folder / f"{FILE}-wal")
    connection.close()
    shutil.rmtree(other)


def folder_instead(folder):
    (folder / FILE).unlink()
    (folder / FILE).mkdir()


def study_of(change):
    def edit(folder):
        file = folder / DEFINITION_FILE
        file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")

    return edit


FILES = {
    "empty": (lambda folder: (folder / FILE).write_bytes(b""), "is a database of another program"),
    "text": (lambda folder: (folder / FILE).write_text("runs\n"), "is not a database of a study"),
    "folder": (folder_instead, "no file runs.sqlite"),
    "missing": (lambda folder: (folder / FILE).unlink(), "no file runs.sqlite"),
    "log of another study": (other_log, LOST),
    "log of zeros": (lambda folder: (folder / f"{FILE}-wal").write_bytes(bytes(9000)), KEPT),
    "changed study": (study_of(lambda text: text.replace("1.0", "1.1")),
                      "study.yaml was changed after its runs were computed; restore it, or"),
    "changed axis": (study_of(lambda text: text.replace("0.05", "0.06")), "was changed after its"),
    "changed seed": (study_of(lambda text: text + "set: {seed: 5}\n"), "was changed after"),
    "cut study": (study_of(lambda text: text[: text.index("axes")]), "was changed after its runs"),
    "comment": (study_of(lambda text: "# mine\n" + text), KEPT),
    "question": (study_of(lambda text: text.replace("Does a", "Is a")), KEPT),
    "no study": (lambda folder: (folder / DEFINITION_FILE).unlink(), "no file study.yaml"),
    "empty study": (study_of(lambda _: ""), "study.yaml"),
    "binary study": (lambda folder: (folder / DEFINITION_FILE).write_bytes(b"\xff\0"), "study."),
}  # fmt: skip
"""Edits of files."""


@pytest.mark.parametrize("name", FILES)
def test_edited_files(whole, tmp_path, caplog, name):
    edit, expected = FILES[name]
    folder = copied(whole, tmp_path)
    edit(folder)
    check(folder, whole[1], expected, caplog)


def test_changed_study_is_not_resumed(whole, tmp_path):
    folder = copied(whole, tmp_path)
    study_of(lambda text: text.replace("0.05", "0.06"))(folder)
    with pytest.raises(OmnidriveError, match="compute the changed study in another folder: omn"):
        load_study(folder, allow_code=False)
