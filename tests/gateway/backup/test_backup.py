"""Backups of a small store: what is in them, what is refused, and what a restored store does not go on with."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gateway.backup.manifest import MANIFEST, SUMS, Manifest, read_manifest
from gateway.backup.restore import Restored, restore
from gateway.backup.snapshot import open_existing
from gateway.backup.tables import tables
from gateway.backup.take import take
from gateway.backup.verify import verify
from gateway.errors import CorruptObjectError, ObjectRefusedError, ObjectStoreError
from gateway.identity.master import MASTER_KEY, make_key_file
from gateway.store.commit import Committer
from gateway.store.integrity.check import check
from gateway.store.ledger import doom, in_transaction, sweep_objects
from gateway.store.object_hold import HOLD_S, hold_objects, objects_held
from gateway.store.object_store_marker import check_marker
from gateway.store.objects import DirectoryStore
from gateway.store.schema import MIGRATIONS
from gateway.store.sqlite import DATABASE, SqliteEngine
from gateway.store.telemetry.compact import Compaction
from gateway.store.telemetry.load import RunLoader
from metaros.clock import ManualClock
from metaros.errors import ConfigError
from tests.gateway.store.samples import CPU, content, gap_write, run_write, write
from tests.support.servers.postgres import PostgresServer

TEXTS = [b"one", b"two", b"three"]


class Home:
    """A data directory with a store in it, and backups of it."""

    def __init__(self, folder: Path, clock: ManualClock) -> None:
        self.folder, self.clock = folder, clock
        folder.mkdir(parents=True, exist_ok=True)
        self.objects = DirectoryStore(folder / "objects")

    def fill(self) -> None:
        """Messages in an object, and a gap; a master key."""
        make_key_file(self.folder / MASTER_KEY)
        engine = SqliteEngine(self.folder)
        engine.open()
        Committer(engine).commit([run_write(1, TEXTS), gap_write(4, 9), write(1, (CPU, 5, 0.5))], now_ns=10**18)
        run = in_transaction(engine)
        check_marker(engine, run, self.objects, clock=self.clock)
        work = Compaction(engine, run, self.objects, clock=self.clock)
        for due in work.due(everything=True):
            while work.compact(due):
                pass
        engine.close()

    def take(
        self, backup: Path, *, on_step: Callable[[str, int, int], None] = lambda *_: None, **more: Any
    ) -> Manifest:
        """A backup of it."""
        engine = open_existing("", self.folder)
        given = {"where": "here", "data_dir": self.folder, "with_master_key": False, "clock": self.clock, **more}
        try:
            return take(engine, self.objects, backup, on_step=on_step, **given)
        finally:
            engine.close()

    def restore(self, backup: Path, *, url: str = "", objects: Any = None) -> Restored:
        """Its store out of a backup."""
        given = {"data_dir": self.folder, "clock": self.clock, "who": "ada", "on_step": lambda *_: None}
        return restore(backup, objects or self.objects, url=url, **given)

    def ask(self, sql: str) -> list[tuple[Any, ...]]:
        """Rows of its database."""
        with sqlite3.connect(self.folder / DATABASE) as connection:
            return connection.execute(sql).fetchall()


@pytest.fixture
def home(tmp_path: Path, clock: ManualClock) -> Home:
    made = Home(tmp_path / "one", clock)
    made.fill()
    return made


@pytest.fixture
def new(tmp_path: Path, clock: ManualClock) -> Home:
    return Home(tmp_path / "two", clock)


def test_a_restored_store_has_everything(home: Home, new: Home, tmp_path: Path) -> None:
    manifest = home.take(tmp_path / "kept", with_master_key=True)
    assert (manifest.objects, manifest.damaged, manifest.schema) == (2, [], len(MIGRATIONS))
    done = new.restore(tmp_path / "kept")
    assert (done.sent, done.keyless) == (2, False)
    assert (new.folder / MASTER_KEY).read_bytes() == (home.folder / MASTER_KEY).read_bytes()
    engine = SqliteEngine(new.folder)
    assert engine.open() == manifest.store_id
    assert check(engine, new.objects, deep=True, now_ns=10**18).damage == []
    assert content(engine, loader=RunLoader(new.objects))[1] == set(range(4, 10))
    engine.close()
    for table in tables():
        if table.name not in ("meta", "audit", "audit_head"):
            assert new.ask(f"SELECT * FROM {table.name}") == home.ask(f"SELECT * FROM {table.name}"), table.name


def test_the_master_key_is_where_the_environment_says(
    home: Home, new: Home, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As for the replicas of one store."""
    shared = tmp_path / "shared.key"
    (home.folder / MASTER_KEY).rename(shared)
    monkeypatch.setenv("METAROS_MASTER_KEY", str(shared))
    manifest = home.take(tmp_path / "kept", with_master_key=True)
    assert manifest.master_key
    assert (tmp_path / "kept" / MASTER_KEY).read_bytes() == shared.read_bytes()
    key = shared.read_bytes()
    shared.write_bytes(b"o" * 32)
    with pytest.raises(ConfigError, match=r"shared\.key is another key"):
        new.restore(tmp_path / "kept")
    shared.unlink()
    assert not new.restore(tmp_path / "kept").keyless
    assert shared.read_bytes() == key
    assert not (new.folder / MASTER_KEY).exists()


def test_objects_that_go_meanwhile_are_in_it(home: Home, new: Home, tmp_path: Path) -> None:
    """Retention dooms every object between the snapshot and their copying; the sweeper waits for the backup."""
    swept = []

    def doom_all(what: str, done: int, total: int) -> None:
        if what == "pages" and done == total:
            engine = open_existing("", home.folder)
            run = in_transaction(engine)
            names = [row[0] for row in home.ask("SELECT name FROM objects")]
            run(lambda engine: [doom(engine, name, home.clock.wall_ns()) for name in names])
            swept.append(sweep_objects(run, home.objects, now_ns=home.clock.wall_ns()))
            engine.close()

    assert home.take(tmp_path / "kept", on_step=doom_all).objects == 2
    assert swept == [0]
    engine = open_existing("", home.folder)
    assert sweep_objects(in_transaction(engine), home.objects, now_ns=home.clock.wall_ns()) == 2
    engine.close()
    assert new.restore(tmp_path / "kept").sent == 2


def test_a_hold_ends_by_itself(home: Home) -> None:
    engine = open_existing("", home.folder)
    in_transaction(engine)(lambda engine: hold_objects(engine, "killed", now_ns=10**18))
    with engine.transaction(write=False):
        assert objects_held(engine, now_ns=10**18)
        assert not objects_held(engine, now_ns=10**18 + round(HOLD_S * 1e9))
        assert not objects_held(engine, now_ns=10**18 - 10**15), "said by a clock that was set back since"
    engine.close()


def test_what_was_damaged_before_does_not_keep_the_rest_from_being_kept(home: Home, new: Home, tmp_path: Path) -> None:
    (name,) = [row[0] for row in home.ask("SELECT object FROM segments")]
    (home.folder / "objects" / name).write_bytes(b"rust")
    assert home.take(tmp_path / "kept").damaged == [name]
    assert verify(tmp_path / "kept", on_step=lambda *_: None).faults == ()
    assert new.restore(tmp_path / "kept").sent == 1


def test_another_object_store_than_its_own_is_refused(home: Home, new: Home, tmp_path: Path) -> None:
    home.objects = new.objects
    with pytest.raises(ObjectRefusedError, match="see --objects"):
        home.take(tmp_path / "kept")
    assert not list(tmp_path.glob("kept*"))


def test_a_backup_that_was_broken_off_is_none(home: Home, new: Home, tmp_path: Path) -> None:
    def stop(what: str, done: int, total: int) -> None:
        if what == "objects":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        home.take(tmp_path / "kept", on_step=stop)
    assert not list(tmp_path.glob("kept*"))
    (tmp_path / "kept").mkdir()
    for attempt in (new.restore, lambda folder: verify(folder, on_step=lambda *_: None)):
        with pytest.raises(ConfigError, match="no whole backup"):
            attempt(tmp_path / "kept")
    with pytest.raises(ConfigError, match="there already"):
        home.take(tmp_path / "kept")
    assert home.ask("SELECT * FROM meta WHERE key LIKE 'hold/%'") == []


def test_every_damaged_file_is_found_and_nothing_is_restored(home: Home, new: Home, tmp_path: Path) -> None:
    home.take(tmp_path / "kept", with_master_key=True)
    files = [path for path in (tmp_path / "kept").rglob("*") if path.is_file()]
    assert len(files) == 6
    for path in files:
        whole = path.read_bytes()
        for bad in (whole[: len(whole) // 2], whole[:20] + bytes([whole[20] ^ 1]) + whole[21:], None):
            path.unlink() if bad is None else path.write_bytes(bad)
            with pytest.raises((CorruptObjectError, ConfigError)):
                new.restore(tmp_path / "kept")
            assert not (new.folder / DATABASE).exists(), path
            path.write_bytes(whole)
            path.chmod(0o600)
    new.restore(tmp_path / "kept")


def test_a_place_that_is_not_empty_is_refused(home: Home, new: Home, tmp_path: Path) -> None:
    home.take(tmp_path / "kept")
    with pytest.raises(ConfigError, match="already"):
        home.restore(tmp_path / "kept")
    make_key_file(new.folder / MASTER_KEY)
    with pytest.raises(ConfigError, match="another key"):
        new.restore(tmp_path / "kept")
    (new.folder / MASTER_KEY).unlink()
    other = Home(tmp_path / "other", home.clock)
    other.fill()
    with pytest.raises(ConfigError, match="another store"):
        new.restore(tmp_path / "kept", objects=other.objects)
    newer = replace(read_manifest(tmp_path / "kept"), schema=999)
    (tmp_path / "kept" / MANIFEST).write_bytes(newer.text())
    with pytest.raises(ConfigError, match="schema 999"):
        new.restore(tmp_path / "kept")
    assert sorted(path.name for path in new.folder.iterdir()) == ["gateway.lock"]


def test_a_restore_that_was_broken_off_goes_on(home: Home, new: Home, tmp_path: Path) -> None:
    home.take(tmp_path / "kept")

    class Failing(DirectoryStore):
        left = 1

        def put(self, name: str, *more: Any, **facts: Any) -> None:
            if not self.left:
                raise ObjectStoreError("no route")
            self.left -= 1
            super().put(name, *more, **facts)

    with pytest.raises(ObjectStoreError, match="no route"):
        new.restore(tmp_path / "kept", objects=Failing(new.folder / "objects"))
    assert sorted(path.name for path in new.folder.iterdir()) == ["gateway.lock", "objects"]
    done = new.restore(tmp_path / "kept")
    assert (done.sent, done.keyless) == (1, True)


def test_the_old_time_is_over(home: Home, new: Home, tmp_path: Path) -> None:
    engine = open_existing("", home.folder)
    now_ns = home.clock.wall_ns()
    with engine.transaction(write=True):
        engine.execute("INSERT INTO users VALUES ('u', 'ada', 'admin', '[]', '', NULL, 0, 1, 1)")
        engine.execute("INSERT INTO sessions VALUES ('s', 'u', 1, 1, ?, '')", now_ns + 10**15)
        engine.execute("INSERT INTO sign_in_links VALUES ('l', 'u', ?)", now_ns + 10**15)
        for token, used_ns in (("open", 0), ("used", 7)):
            ends_ns = now_ns + 10**15
            row = (token, "", "", "ada", 1, ends_ns, used_ns, "", "")
            engine.execute("INSERT INTO enrolment_tokens VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", *row)
        engine.execute("INSERT INTO gateways VALUES ('old', ?)", now_ns + 10**15)
        engine.execute("INSERT INTO presence VALUES ('r1', 'old', 1, 1)")
        engine.execute("INSERT INTO duties VALUES ('rollouts', 'old', ?)", now_ns + 10**15)
        engine.execute("INSERT INTO node_leases VALUES ('t', 'n', 'r1', 'old.3', 3, 9, 'old', 1)")
        engine.execute("INSERT INTO rollouts VALUES ('x', 'running', '', 1, '{}', 'ada', 1, 1, 4)")
        engine.execute("INSERT INTO update_metadata VALUES ('timestamp', 5, ?, ?, 1)", b"{}", now_ns + 10**15)
    engine.close()
    home.take(tmp_path / "kept")
    invalidated = new.restore(tmp_path / "kept").invalidated
    assert (invalidated.sessions, invalidated.tokens, invalidated.rollouts, invalidated.users) == (1, 1, 1, 1)
    assert new.ask("SELECT count(*) FROM sign_in_links") == [(0,)]
    assert new.ask("SELECT count(*) FROM enrolment_tokens WHERE used_ns = 0 AND expires_ns > " + str(now_ns)) == [(0,)]
    assert new.ask("SELECT state, revision FROM rollouts") == [("paused", 5)]
    assert new.ask("SELECT online FROM presence") == [(0,)]
    assert new.ask(f"SELECT count(*) FROM duties WHERE until_ns > {now_ns}") == [(0,)]
    floor = now_ns // 10**9
    assert new.ask("SELECT epoch FROM node_leases") == [(floor,)]
    assert new.ask("SELECT value FROM meta WHERE key = 'updates_version_floor'") == [(str(floor),)]
    assert new.ask("SELECT expires_ns FROM update_metadata") == [(now_ns,)]
    assert new.ask("SELECT action, name FROM audit ORDER BY number DESC LIMIT 1") == [("store.restore", "ada")]
    assert new.ask("SELECT * FROM meta WHERE key LIKE 'hold/%'") == []


def test_postgresql_is_refused_unless_it_is_empty(
    home: Home, new: Home, tmp_path: Path, postgres: PostgresServer
) -> None:
    home.take(tmp_path / "kept")
    url = postgres.schema(empty=True)
    assert new.restore(tmp_path / "kept", url=url).sent == 2
    with pytest.raises(ConfigError, match="not empty"):
        new.restore(tmp_path / "kept", url=url)
    engine = open_existing(url, new.folder)
    given = {"where": url, "data_dir": new.folder, "with_master_key": False, "clock": home.clock}
    manifest = take(engine, new.objects, tmp_path / "again", on_step=lambda *_: None, **given)
    assert (manifest.database, manifest.store_id) == ("postgresql", read_manifest(tmp_path / "kept").store_id)
    with engine.transaction(write=True):  # the numbers that the database gives go on behind the restored ones
        engine.execute(
            "INSERT INTO robots (id, namespace, hostname, agent_version, labels, first_seen_ns, last_seen_ns)"
            " VALUES ('new', '', '', '', '{}', 1, 1)"
        )
        assert engine.fetch("SELECT robot FROM robots WHERE id = 'new'")[0][0] == 2
    engine.close()
    assert verify(tmp_path / "again", on_step=lambda *_: None).faults == ()


def test_a_stranger_checks_it_with_sha256sum(home: Home, tmp_path: Path) -> None:
    home.take(tmp_path / "kept")
    lines = (tmp_path / "kept" / SUMS).read_text().splitlines()
    assert [line[64:66] for line in lines] == ["  "] * 3
    assert {line[66:].split("/")[0] for line in lines} == {"objects", DATABASE}
