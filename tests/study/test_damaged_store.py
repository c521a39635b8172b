"""Damaged bytes and pages of the store of a study: no reader returns other values."""

import random
import shutil
import sqlite3

import pytest

from omnidrive.errors import CannotWrite, InvalidStore
from omnidrive.study.computation.run_recording import relabelled
from omnidrive.study.storage import store_errors
from omnidrive.study.storage.store import FILE, Store
from tests.study.synthetic import SyntheticPlan, record

PAGE = 4096
PLAN = SyntheticPlan(300)
RECORDS = [record(PLAN[number]) for number in range(len(PLAN))]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A store, and its rows by number as texts, in which NaN is equal to itself."""
    folder = tmp_path_factory.mktemp("whole")
    with Store(folder) as store:
        store.begin("definition")
        store.add(RECORDS)
        rows = store.records().to_pylist()
    return folder, {row["number"]: row for row in rows}


def flip_bits(data, source):
    for _ in range(source.choice([1, 3, 20])):
        data[source.randrange(100, len(data))] ^= 1 << source.randrange(8)


def overwrite(data, source):
    for _ in range(source.choice([1, 3])):
        place = source.randrange(100, len(data))
        data[place : place + 60] = source.randbytes(60)


def clear_page(data, source):
    place = _page(data, source)
    data[place : place + PAGE] = bytes(PAGE)


def repeat_page(data, source):
    to, of = _page(data, source), _page(data, source)
    data[to : to + PAGE] = data[of : of + PAGE]


def exchange_pages(data, source):
    a, b = _page(data, source), _page(data, source)
    data[a : a + PAGE], data[b : b + PAGE] = data[b : b + PAGE], data[a : a + PAGE]


def cut(data, source):
    del data[source.randrange(100, len(data)) :]


def _page(data, source):
    return PAGE * source.randrange(1, len(data) // PAGE)


DAMAGES = (flip_bits, overwrite, clear_page, repeat_page, exchange_pages, cut)


def check_rows(rows, whole, what):
    """Check that rows have the values that were stored."""
    for row in rows:
        stored = {name: whole[row["number"]][name] for name in row}
        assert repr(row) == repr(stored), what


def check(whole, folder, damage, seed):
    """Damage a store; return the number of runs that are read, -1: none, and whether it resumes."""
    source, what = random.Random(f"{damage.__name__} {seed}"), f"{damage.__name__} {seed}"
    original, rows = whole
    data = bytearray((original / FILE).read_bytes())
    damage(data, source)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (folder / FILE).write_bytes(data)
    read = -1
    try:
        with Store(folder, read_only=True) as store:
            tables, status = store.tables(), store.status()
        found = tables.records.to_pylist()
        check_rows(found, rows, what)
        read = len(found)
        assert read == status.runs == len({row["number"] for row in found}), what
        assert read + tables.loss.runs == len(PLAN), what
        assert tables.loss == status.loss
        assert not set(tables.loss.numbers) & {row["number"] for row in found}
        assert tables.timing["number"].to_pylist() == tables.records["number"].to_pylist()
    except (InvalidStore, CannotWrite):  # one sentence
        pass
    return read, resumed(folder, rows, what)


def resumed(folder, rows, what):
    """Return whether a damaged store is opened for writing; then it must become whole again."""
    try:
        store = Store(folder)
    except (InvalidStore, CannotWrite):
        return False
    with store:
        assert not store.status().loss.runs, what
        missing = set(store.missing(PLAN))
        known = store.results(RECORDS[number].key for number in missing)
        assert all(known[r.key].metrics.keys() == r.metrics.keys() for r in RECORDS
                   if r.key in known)  # fmt: skip
        store.add([RECORDS[number] for number in missing])
        found = store.records().to_pylist()
        assert [row["number"] for row in found] == list(range(len(PLAN))), what
        check_rows(found, rows, what)
        assert not store.status().loss.runs, what
    return True


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_store_is_read_without_other_values(whole, tmp_path, damage):
    results = [check(whole, tmp_path / "a", damage, seed) for seed in range(3)]
    if damage in {flip_bits, overwrite}:
        assert max(read for read, _ in results) > 0


@pytest.mark.long
@pytest.mark.parametrize("damage", DAMAGES)
def test_any_damaged_store_is_read_without_other_values(whole, tmp_path, damage):
    for seed in range(3, 53):
        check(whole, tmp_path / "a", damage, seed)


def changed(folder, original, statement):
    """Copy a store, change it with a statement, and return its folder."""
    shutil.copytree(original, folder)
    connection = sqlite3.connect(folder / FILE)
    connection.executescript(statement)
    connection.close()
    return folder


@pytest.mark.parametrize(
    ("statement", "lost", "text"),
    [
        ("UPDATE results SET outcome = 'finishes' WHERE key = (SELECT key FROM results LIMIT 1)",
         1, "1 stored run is damaged and left out (numbers "),
        ("UPDATE runs SET pairing = pairing + 1 WHERE number IN (3, 5)",
         2, "2 stored runs are damaged and left out (numbers 3, 5)"),
        ("DELETE FROM results WHERE id IN (SELECT result FROM runs WHERE number = 7)",
         1, "1 stored run is damaged and left out (numbers 7)"),
        ("DELETE FROM runs WHERE number IN (1, 2); UPDATE runs SET task = '' WHERE number = 4",
         3, "3 stored runs are damaged and left out (numbers 4), the numbers of 2 of them are "
         "unknown"),
        ("DELETE FROM runs WHERE number = 1", 1, "1 stored run is damaged and left out"),
        ("DELETE FROM runs", 300, "300 stored runs are damaged and left out"),
    ],
)  # fmt: skip
def test_damaged_and_lost_rows_are_named(whole, tmp_path, statement, lost, text, caplog):
    folder = changed(tmp_path / "a", whole[0], statement)
    with Store(folder, read_only=True) as store:
        loss = store.status().loss
        assert loss == store.tables().loss
    assert loss.runs == lost
    assert str(loss).startswith(text)
    assert resumed(folder, whole[1], statement)
    assert "computed again" in caplog.text


def test_damaged_result_is_computed_again(whole, tmp_path):
    """The run with its key is computed, although its row is still there."""
    folder = shutil.copytree(whole[0], tmp_path / "a")
    key = RECORDS[9].key
    with Store(folder) as store:
        with store.transaction() as connection:
            connection.execute("UPDATE results SET detail = 'x' WHERE key = ?", (key,))
        assert not store.results([key])
        assert store.status().loss.numbers == (9,)
        store.add([RECORDS[9]])
        assert repr(relabelled(store.results([key])[key], PLAN[9])) == repr(RECORDS[9])
        assert not store.status().loss.runs


def test_cut_file_is_read_and_rebuilt(whole, tmp_path, caplog):
    """What is read of a file without its last tenth is kept, and the file stays beside it."""
    data = (whole[0] / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(data[: len(data) * 9 // 10])
    with Store(tmp_path, read_only=True) as store:
        status = store.status()
    assert 0 < status.runs < len(PLAN)
    assert status.runs + status.loss.runs == len(PLAN)
    with Store(tmp_path) as store:
        assert store.status().runs == status.runs
        assert store.fact("definition") == "definition"
    assert "results are kept" in caplog.text
    assert "the damaged file is now runs-damaged.sqlite" in caplog.text
    assert (tmp_path / "runs-damaged.sqlite").read_bytes() == data[: len(data) * 9 // 10]
    assert resumed(tmp_path, whole[1], "cut")
    assert {path.name for path in tmp_path.iterdir()} == {FILE, "runs-damaged.sqlite"}


def test_results_of_lost_runs_are_kept(whole, tmp_path):
    """Where the table of runs is unreadable, runs are found by the keys of their results."""
    folder = changed(tmp_path / "a", whole[0], "")
    connection = sqlite3.connect(folder / FILE)
    ((page,),) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'runs'")
    connection.close()
    data = bytearray((folder / FILE).read_bytes())
    data[PAGE * (page - 1) : PAGE * page] = bytes(PAGE)
    (folder / FILE).write_bytes(data)
    with Store(folder) as store:
        assert store.status().runs == 0
        assert len(store.results(each.key for each in RECORDS)) == len(RECORDS)


def leaves(data, root):
    """Return the places of the leaves below the root page of a table of two levels."""
    page = data[PAGE * (root - 1) : PAGE * root]
    assert page[0] == 5  # an interior page of a table
    cells = [int.from_bytes(page[12 + 2 * k : 14 + 2 * k], "big") for k in range(page[4])]
    below = [int.from_bytes(page[cell : cell + 4], "big") for cell in cells]
    return [PAGE * (number - 1) for number in below]


def test_rows_of_a_page_that_occurs_twice_count_once(whole, tmp_path):
    data = bytearray((whole[0] / FILE).read_bytes())
    connection = sqlite3.connect(whole[0] / FILE)
    ((root,),) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'runs'")
    connection.close()
    first, second, *_ = leaves(data, root)
    data[second : second + PAGE] = data[first : first + PAGE]
    (tmp_path / FILE).write_bytes(data)
    with Store(tmp_path, read_only=True) as store:
        status, tables = store.status(), store.tables()
    assert 0 < status.runs == tables.records.num_rows < len(PLAN)
    assert status.runs + status.loss.runs == len(PLAN)
    assert resumed(tmp_path, whole[1], "page that occurs twice")


def test_store_in_use_is_not_rebuilt(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(store_errors, "PATIENCE", 0.05)
    folder = changed(tmp_path / "a", whole[0], "UPDATE runs SET task = '' WHERE number = 4")
    with Store(folder, read_only=True) as store:
        store.status()
        with pytest.raises(CannotWrite, match="another program has locked it"):
            Store(folder)
    assert not (folder / "runs-damaged.sqlite").exists()
    Store(folder).close()


def test_store_without_valid_results_is_refused(whole, tmp_path):
    folder = changed(tmp_path / "a", whole[0], "UPDATE results SET outcome = ''")
    before = (folder / FILE).read_bytes()
    with pytest.raises(InvalidStore, match=r"no run in it can be read; it was not changed. Rest"):
        Store(folder)
    assert (folder / FILE).read_bytes() == before
