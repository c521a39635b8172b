"""The store of a study: what it keeps, and what it does with files that are not its own."""

import os
import random
import shutil
import sqlite3
import subprocess
import sys
from dataclasses import replace
from threading import Thread

import pytest

from omnidrive.errors import CannotWrite, InvalidStore
from omnidrive.study.computation.run_recording import relabelled
from omnidrive.study.storage import store as store_module
from omnidrive.study.storage import store_errors
from omnidrive.study.storage.store import FILE, Store
from tests.study.synthetic import SyntheticPlan, record, table_bytes

PLAN = SyntheticPlan(60, period=45)
RECORDS = [record(PLAN[number]) for number in range(len(PLAN))]


def filled(folder, records=RECORDS):
    """Write a store, and return its folder."""
    with Store(folder) as store:
        store.begin("definition")
        store.add(records)
    return folder


def table(folder):
    with Store(folder, read_only=True) as store:
        return store.records()


def test_table_has_the_order_of_the_plan_and_exact_numbers(tmp_path):
    shuffled = random.Random(1).sample(RECORDS, len(RECORDS))
    for k, records in enumerate([RECORDS, shuffled]):
        (tmp_path / str(k)).mkdir()
        filled(tmp_path / str(k), records)
    tables = [table(tmp_path / str(k)) for k in range(2)]
    assert table_bytes(tables[0]) == table_bytes(tables[1])
    assert tables[0].column_names == [
        "number", "key", "pairing", "controller", "task", "duration", "variant", "repetition",
        "repeat", "outcome", "finished", "factor:plant_robot.mass", "factor:sample_time", "me",
        "arrival", "tiny",
    ]  # fmt: skip
    assert tables[0]["number"].to_pylist() == list(range(60))
    for row, written in zip(tables[0].to_pylist(), RECORDS, strict=True):
        assert row["me"].hex() == written.metrics["me"].hex()
        assert row["tiny"].hex() == written.metrics["tiny"].hex()
        assert str(row["arrival"]) == str(written.metrics["arrival"])  # NaN is no null
        assert row["factor:plant_robot.mass"] == written.factors["plant_robot.mass"]
        assert (row["finished"], row["outcome"]) == (written.finished, written.outcome)


def test_columns_of_runs_with_different_metrics_and_factors(tmp_path, monkeypatch):
    monkeypatch.setattr("omnidrive.study.storage.stored_rows._CHUNK", 2)
    values = [{"a": 1}, {"a": 2.5}, {"a": "x", "b": True}, {"b": False}]
    metrics = [{"me": 1.0}, {"me": 2.0}, {"overshoot_x": 3.0}, {}]
    filled(
        tmp_path,
        [
            replace(RECORDS[k], factors=values[k], metrics=metrics[k])
            for k in range(4)
        ],
    )  # fmt: skip
    found = table(tmp_path)
    assert found["factor:a"].to_pylist() == ["1", "2.5", "x", None]
    assert found["factor:b"].to_pylist() == [None, None, True, False]
    assert found["me"].to_pylist() == [1.0, 2.0, None, None]
    assert found["overshoot_x"].to_pylist() == [None, None, 3.0, None]


def test_empty_store_has_an_empty_table(tmp_path):
    filled(tmp_path, [])
    assert table(tmp_path).num_rows == 0


def test_result_is_stored_once_and_the_first_one_is_kept(tmp_path):
    filled(tmp_path)
    with Store(tmp_path) as store:
        store.add(RECORDS[:5])
        ((count,),) = store._connection.execute("SELECT COUNT(*) FROM results")
        assert count == PLAN.period
        assert store.status().runs == len(PLAN)
        assert store.timing().column_names == ["number", "step_time_median"]


def test_status_counts_outcomes_and_names_failures(tmp_path):
    with Store(filled(tmp_path), read_only=True) as store:
        status = store.status()
    failed = [each.number for each in RECORDS if not each.finished]
    assert status.outcomes == {"controller_failed": len(failed), "finished": 60 - len(failed)}
    assert status.failures == [(number, "at 3 s: it failed") for number in failed[:5]]


def test_missing_runs_are_those_that_are_not_stored(tmp_path, monkeypatch):
    monkeypatch.setattr(store_module, "_RANGE", 7)
    filled(tmp_path, RECORDS[3:11] + RECORDS[40:41])
    with Store(tmp_path) as store:
        assert list(store.missing(PLAN)) == [0, 1, 2, *range(11, 40), *range(41, 60)]
        assert list(store.missing(PLAN, 50)) == list(range(50, 60))


def test_another_definition_finds_the_results_by_their_keys(tmp_path, caplog):
    filled(tmp_path)
    with Store(tmp_path) as store:
        store.begin("other")
        store.begin("other")
        (note,) = caplog.messages
        assert "what its runs depend on has changed" in note
        assert store.status().runs == 0
        keys = PLAN.keys(0, 3)
        found = store.results([*keys, "0" * 64])
        assert list(found) == keys
        assert relabelled(found[keys[2]], PLAN[2]) == RECORDS[2]


def test_records_of_a_failed_transaction_are_not_stored(tmp_path):
    filled(tmp_path, RECORDS[:10])
    with Store(tmp_path) as store:
        with pytest.raises(ZeroDivisionError), store.transaction() as connection:
            connection.execute("DELETE FROM runs").connection.interrupt = 1 / 0
        assert store.status().runs == 10


# bad files and folders


def test_full_disk_is_reported_and_stored_runs_are_kept(tmp_path):
    filled(tmp_path, RECORDS[:10])
    with Store(tmp_path) as store:
        ((pages,),) = store._connection.execute("PRAGMA page_count")
        store._connection.execute(f"PRAGMA max_page_count = {pages}")
        many = [record(SyntheticPlan(5000)[number]) for number in range(100, 2000)]
        with pytest.raises(CannotWrite, match=r"no space left; free disk .*Finished runs are kept"):
            store.add(many)
        assert store.status().runs == 10
    assert table(tmp_path).num_rows == 10


LIMITED = """
import resource, sys
from omnidrive.errors import CannotWrite
from omnidrive.study.storage.store import Store
from tests.study.test_store import RECORDS
with Store(sys.argv[1]) as store:
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
    try:
        for _ in range(100):
            store.begin(str(_))
            store.add(RECORDS)
    except CannotWrite as error:
        print(error)
"""


@pytest.mark.long
def test_file_that_cannot_grow_is_reported_and_stored_runs_are_kept(tmp_path):
    filled(tmp_path, RECORDS[:10])
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, tmp_path], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, timeout=60,
    )  # fmt: skip
    assert "the disk reports an error, or is full" in done.stdout, done.stderr
    with Store(tmp_path) as store:
        assert store.status().runs in {0, 60}  # whole transactions
        assert len(store.results(PLAN.keys(0, 10))) == 10


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="needs a user with limits")
def test_read_only_folder_is_reported(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(CannotWrite, match="cannot be written"):
        Store(tmp_path)


def test_read_only_database_is_read_and_not_written(tmp_path):
    filled(tmp_path)
    with Store(tmp_path, read_only=True) as store:
        with pytest.raises(CannotWrite, match="it is read-only; choose a folder that can be wr"):
            store.add(RECORDS)
        assert store.records().num_rows == 60


def test_missing_folder_and_missing_store_are_reported(tmp_path):
    with pytest.raises(CannotWrite, match="the folder does not exist or cannot be written"):
        Store(tmp_path / "none")
    with pytest.raises(InvalidStore, match=r"there is no study in .*: no file runs\.sqlite"):
        Store(tmp_path, read_only=True)
    assert not list(tmp_path.iterdir())


def test_locked_database_is_reported(tmp_path, monkeypatch):
    filled(tmp_path)
    monkeypatch.setattr(store_errors, "PATIENCE", 0.05)
    with Store(tmp_path) as store:
        other = sqlite3.connect(tmp_path / FILE, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(CannotWrite, match="another program has locked it for"):
            store.add(RECORDS)
        other.execute("ROLLBACK")
        other.close()
        store.add(RECORDS)


@pytest.mark.parametrize("read_only", [False, True])
@pytest.mark.parametrize("content", [b"precious text " * 100, b"\0" * 5000])
def test_file_that_is_no_database_is_not_changed(tmp_path, content, read_only):
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(InvalidStore, match="is not a database of a study; it was not changed"):
        Store(tmp_path, read_only=read_only)
    assert (tmp_path / FILE).read_bytes() == content


def test_database_of_another_program_is_not_changed(tmp_path):
    other = sqlite3.connect(tmp_path / FILE)
    other.execute("CREATE TABLE precious (a)")
    other.commit()
    other.close()
    before = (tmp_path / FILE).read_bytes()
    for read_only in (False, True):
        with pytest.raises(InvalidStore, match="is a database of another program"):
            Store(tmp_path, read_only=read_only)
    assert (tmp_path / FILE).read_bytes() == before


def test_database_of_a_newer_version_is_not_changed(tmp_path):
    filled(tmp_path)
    other = sqlite3.connect(tmp_path / FILE)
    other.execute("PRAGMA user_version = 99")
    other.close()
    with pytest.raises(InvalidStore, match=r"newer version .* \(version 99 .*; update omnidrive"):
        Store(tmp_path)


def damage(folder, seed):
    """Overwrite bytes of the database behind its header, at random."""
    source = random.Random(seed)
    data = bytearray((folder / FILE).read_bytes())
    for _ in range(20):
        place = source.randrange(100, len(data))
        data[place : place + 60] = source.randbytes(60)
    (folder / FILE).write_bytes(data)
    return bytes(data)


def check_damage(tmp_path, seeds):
    """Check that a damaged database is read as it was, rebuilt or refused; never more."""
    filled(tmp_path)
    whole, reported = table(tmp_path), 0
    for seed in seeds:
        folder = tmp_path / f"damaged-{seed}"
        folder.mkdir()
        shutil.copy(tmp_path / FILE, folder)
        damage(folder, seed)
        try:
            with Store(folder) as store:
                assert store.records().schema.names[:10] == whole.schema.names[:10]
            reported += (folder / "runs-damaged.sqlite").exists()
        except InvalidStore as error:
            reported += "is damaged" in str(error) or "is not a database" in str(error)
        except (CannotWrite, UnicodeDecodeError) as error:
            raise AssertionError(f"seed {seed}: {error}") from error
    return reported


def test_damaged_database_is_reported(tmp_path):
    assert check_damage(tmp_path, [*range(12), 16]) >= 11


@pytest.mark.long
def test_any_damage_of_a_database_is_reported(tmp_path):
    assert check_damage(tmp_path, range(500)) >= 400


def test_processes_that_create_a_store_at_the_same_time_agree(tmp_path):
    errors = []

    def create():
        try:
            with Store(tmp_path) as store:
                store.begin("definition")
        except Exception as error:
            errors.append(error)

    threads = [Thread(target=create) for _ in range(8)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert not errors
    filled(tmp_path)
    assert table(tmp_path).num_rows == 60
