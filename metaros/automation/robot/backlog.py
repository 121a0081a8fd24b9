"""What waits on the robot's disk: events for the handler, what conditions remember, results for the agent.

One SQLite file, synchronised at every commit: what was put is there after a kill -9 or a power cut. Everything is
bounded in rows, bytes and age. Thread-safe; every method blocks for a disk's moment.
"""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from metaros.errors import ConfigError
from metaros.limits import LIMITS, Limits

__all__ = ["Backlog", "ConditionState", "Counts", "Event", "NewEvent", "Result"]

VERSION: Final = 1
_SCHEMA: Final = """
CREATE TABLE events (id INTEGER PRIMARY KEY AUTOINCREMENT, trigger TEXT NOT NULL, name TEXT NOT NULL,
  payload BLOB NOT NULL, born_ns INTEGER NOT NULL, due_ns INTEGER NOT NULL, attempts INTEGER NOT NULL DEFAULT 0,
  losses INTEGER NOT NULL DEFAULT 0, leased INTEGER NOT NULL DEFAULT 0, dead TEXT NOT NULL DEFAULT '',
  UNIQUE (trigger, name));
CREATE INDEX events_due ON events (due_ns) WHERE leased = 0 AND dead = '';
CREATE TABLE memories (trigger TEXT NOT NULL, part TEXT NOT NULL, state TEXT NOT NULL, last BLOB NOT NULL,
  due_ns INTEGER NOT NULL, seen_ns INTEGER NOT NULL, PRIMARY KEY (trigger, part)) WITHOUT ROWID;
CREATE TABLE results (id INTEGER PRIMARY KEY AUTOINCREMENT, document TEXT NOT NULL, sent_ns INTEGER);
"""
_WAITS: Final = "leased = 0 AND dead = ''"


@dataclass(frozen=True, slots=True, kw_only=True)
class NewEvent:
    """An event to keep. `name` is its own for ever: what is put twice for a trigger is kept once."""

    trigger: str
    name: str
    payload: bytes
    at_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One that is under way. `attempts` counts this one, and not `losses`, which ended with a life of the program."""

    id: int
    trigger: str
    name: str
    payload: bytes
    born_ns: int
    attempts: int
    losses: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionState:
    """What a trigger's condition remembers of a group (`part`); `last` is the event that a timer would act with."""

    trigger: str
    part: str
    state: str
    last: bytes
    due_ns: int
    seen_ns: int


@dataclass(frozen=True, slots=True)
class Result:
    """A document for the agent."""

    id: int
    document: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """How much there is."""

    waiting: int
    under_way: int
    dead: int
    unsent: int


class Backlog:
    """`open` it for one process at a time (a lock is the program's); `close` it at the end."""

    def __init__(self, path: Path, *, limits: Limits = LIMITS) -> None:
        """Raises ConfigError where the file is no backlog of this version, or the disk refuses."""
        self._limits = limits
        self._lock = threading.Lock()
        self.refused = 0  # events that found it full
        try:
            self._db = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = FULL")
            self._prepare(path)
        except sqlite3.Error as error:
            raise ConfigError(f"{path}: {error}") from error

    def close(self) -> None:
        """Nothing may be asked of it afterwards."""
        with self._lock:
            self._db.close()

    # -- in ------------------------------------------------------------------------------------------------------

    def keep(self, puts: Sequence[NewEvent], condition_states: Sequence[ConditionState]) -> int:
        """Events and what conditions remember now, together; how many events are new. What finds it full is refused."""
        new = 0
        with self._transaction() as db:
            rows, size = db.execute("SELECT count(*), coalesce(sum(length(payload)), 0) FROM events").fetchone()
            for put in puts:
                size += len(put.payload)
                if rows + new >= self._limits.robot_events or size > self._limits.robot_events_bytes:
                    self.refused += 1
                    continue
                sql = "INSERT INTO events (trigger, name, payload, born_ns, due_ns) VALUES (?, ?, ?, ?, ?)"
                values = (put.trigger, put.name, put.payload, put.at_ns, put.at_ns)
                new += db.execute(f"{sql} ON CONFLICT DO NOTHING", values).rowcount
            for one in condition_states:
                self._remember(db, one)
        return new

    def condition_states(self) -> list[ConditionState]:
        """All that is remembered."""
        with self._lock:
            rows = self._db.execute("SELECT trigger, part, state, last, due_ns, seen_ns FROM memories").fetchall()
        names = ("trigger", "part", "state", "last", "due_ns", "seen_ns")
        return [ConditionState(**dict(zip(names, row, strict=True))) for row in rows]

    # -- out -----------------------------------------------------------------------------------------------------

    def recover(self) -> int:
        """What a former life had under way waits again, and counts a loss; how many."""
        with self._transaction() as db:
            sql = "UPDATE events SET leased = 0, losses = losses + 1, attempts = attempts - 1 WHERE leased = 1"
            return db.execute(sql).rowcount

    def lease(self, most: int, *, now_ns: int) -> list[Event]:
        """Events that are due, the oldest first; they are under way from now on."""
        with self._transaction() as db:
            due = f"SELECT id FROM events WHERE {_WAITS} AND due_ns <= ? ORDER BY due_ns, id LIMIT ?"
            sql = f"UPDATE events SET leased = 1, attempts = attempts + 1 WHERE id IN ({due}) RETURNING "
            sql += "id, trigger, name, payload, born_ns, attempts, losses"
            rows = db.execute(sql, (now_ns, most)).fetchall() if most > 0 else []
        names = ("id", "trigger", "name", "payload", "born_ns", "attempts", "losses")
        return sorted((Event(**dict(zip(names, row, strict=True))) for row in rows), key=lambda event: event.id)

    def next_due_ns(self) -> int | None:
        """When the next one that waits is due."""
        with self._lock:
            found = self._db.execute(f"SELECT min(due_ns) FROM events WHERE {_WAITS}").fetchone()[0]
        return int(found) if found is not None else None

    def settle(self, event: Event, result: Mapping[str, object], *, again_ns: int = 0, dead: str = "") -> None:
        """An attempt is over: the event is done, tried again at `again_ns`, or dead for the reason given."""
        document = json.dumps(result, ensure_ascii=False, separators=(",", ":"))
        with self._transaction() as db:
            if dead:
                db.execute("UPDATE events SET leased = 0, dead = ? WHERE id = ?", (dead, event.id))
                self._keep_newest(db, "events", "dead != ''", self._limits.robot_dead_letters)
            elif again_ns:
                db.execute("UPDATE events SET leased = 0, due_ns = ? WHERE id = ?", (again_ns, event.id))
            else:
                db.execute("DELETE FROM events WHERE id = ?", (event.id,))
            db.execute("INSERT INTO results (document) VALUES (?)", (document,))
            self._keep_newest(db, "results", "1", self._limits.robot_results)

    def put_back(self, event: Event, *, again_ns: int) -> None:
        """It was not tried at all."""
        with self._transaction() as db:
            sql = "UPDATE events SET leased = 0, attempts = attempts - 1, due_ns = ? WHERE id = ?"
            db.execute(sql, (again_ns, event.id))

    def redrive(self, *, now_ns: int) -> int:
        """All that is dead is tried again from the beginning; how many."""
        with self._transaction() as db:
            sql = "UPDATE events SET dead = '', attempts = 0, losses = 0, born_ns = ?, due_ns = ? WHERE dead != ''"
            return db.execute(sql, (now_ns, now_ns)).rowcount

    # -- results -------------------------------------------------------------------------------------------------

    def unsent(self, most: int) -> list[Result]:
        """Results that nobody was given, the oldest first."""
        with self._lock:
            sql = "SELECT id, document FROM results WHERE sent_ns IS NULL ORDER BY id LIMIT ?"
            return [Result(*row) for row in self._db.execute(sql, (most,))]

    def sent(self, results: Sequence[Result], *, now_ns: int) -> None:
        """They were handed over. They stay for a while: whoever got them may have lost them."""
        with self._transaction() as db:
            ids = [(now_ns, result.id) for result in results]
            db.executemany("UPDATE results SET sent_ns = ? WHERE id = ?", ids)

    def send_again(self, *, since_ns: int) -> int:
        """What was handed over since then is handed over once more; what was before is let go. How many."""
        with self._transaction() as db:
            db.execute("DELETE FROM results WHERE sent_ns < ?", (since_ns,))
            return db.execute("UPDATE results SET sent_ns = NULL WHERE sent_ns IS NOT NULL").rowcount

    def forget_sent(self, *, before_ns: int) -> int:
        """Let go of what was handed over before then; how many."""
        with self._transaction() as db:
            return db.execute("DELETE FROM results WHERE sent_ns < ?", (before_ns,)).rowcount

    def counts(self) -> Counts:
        """How much there is now."""
        with self._lock:
            one = self._db.execute(
                f"SELECT coalesce(sum({_WAITS}), 0), coalesce(sum(leased), 0), coalesce(sum(dead != ''), 0) FROM events"
            ).fetchone()
            unsent = self._db.execute("SELECT count(*) FROM results WHERE sent_ns IS NULL").fetchone()[0]
        return Counts(waiting=one[0], under_way=one[1], dead=one[2], unsent=unsent)

    # -- parts ---------------------------------------------------------------------------------------------------

    def _prepare(self, path: Path) -> None:
        found = self._db.execute("PRAGMA user_version").fetchone()[0]
        if found == VERSION:
            return
        if found:
            raise ConfigError(f"{path} is of version {found}; this program knows {VERSION}")
        self._db.executescript(f"BEGIN; {_SCHEMA} PRAGMA user_version = {VERSION}; COMMIT;")

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
            except BaseException:
                self._db.execute("ROLLBACK")
                raise
            self._db.execute("COMMIT")

    def _remember(self, db: sqlite3.Connection, one: ConditionState) -> None:
        if not one.state:
            db.execute("DELETE FROM memories WHERE trigger = ? AND part = ?", (one.trigger, one.part))
            return
        values = (one.trigger, one.part, one.state, one.last, one.due_ns, one.seen_ns)
        db.execute("INSERT OR REPLACE INTO memories VALUES (?, ?, ?, ?, ?, ?)", values)

    def _keep_newest(self, db: sqlite3.Connection, table: str, condition: str, most: int) -> None:
        sql = f"DELETE FROM {table} WHERE {condition} AND id <= (SELECT id FROM {table} WHERE {condition}"
        db.execute(f"{sql} ORDER BY id DESC LIMIT 1 OFFSET ?)", (most,))
