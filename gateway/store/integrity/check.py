"""Checks a store's integrity: ledger against objects, objects against their checksums, samples against watermarks.

It runs beside a working gateway, changes nothing, and names what is damaged; all else goes on being served. The last
report is kept in the database, where the gateway shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field

import orjson

from gateway.store.engine import StoreEngine
from gateway.store.integrity.objects import BadObject, bad_objects, orphans, read_ledger, unreadable
from gateway.store.integrity.series import bad_chunks
from gateway.store.integrity.streams import Fault, stream_faults
from gateway.store.ledger import Transact, sweep_objects
from gateway.store.objects import ObjectStore

__all__ = ["OURS", "Damage", "Report", "check", "delete_orphans", "last_report", "remember"]

OURS = ("segments/", "recordings/")  # where the gateway puts objects; it deletes nothing else
KEPT = 100  # of the damage that the database remembers
_KEY = "last_check"
_TOPICS = (
    "SELECT r.id, c.topic, min(b.first_ns), max(b.last_ns), CAST(sum(b.count) AS BIGINT) FROM segment_runs b"
    " JOIN segments s ON s.segment = b.segment JOIN robots r ON r.robot = b.robot"
    " JOIN channels c ON c.channel = b.channel WHERE s.object = ? GROUP BY r.id, c.topic ORDER BY c.topic"
)
_RECORDING = (
    "SELECT r.id, NULL, q.first_ns, q.last_ns, q.messages FROM recordings q JOIN robots r ON r.robot = q.robot"
    " WHERE q.object = ?"
)


@dataclass(frozen=True, slots=True)
class Damage:
    """Something that is not as it should be. What is not known is None; `topic` may be the name of a series.

    `what`: missing, size, corrupt or ledger (data is lost); hole, twice or ahead (of a stream); unused, orphan (space).
    """

    what: str
    detail: str
    object: str | None = None
    robot: str | None = None
    topic: str | None = None
    first_ns: int | None = None
    last_ns: int | None = None


@dataclass(slots=True)
class Report:
    """What was looked at and what was found; `damage` is what to worry about, `orphans` objects nobody knows."""

    deep: bool
    checked_ns: int
    objects: int = 0
    size_bytes: int = 0
    streams: int = 0
    damage: list[Damage] = field(default_factory=list)
    orphans: list[Damage] = field(default_factory=list)


def check(
    engine: StoreEngine,
    objects: ObjectStore,
    *,
    deep: bool,
    now_ns: int,
    on_object: Callable[[int, int], None] = lambda done, total: None,
) -> Report:
    """Look at everything; with `deep` every object and chunk is read through, and `on_object` told how many are done.

    Raises:
        StoreError, ObjectStoreError: one of the stores cannot be asked now; that is no damage.
    """
    report = Report(deep, now_ns)
    stored = {name: entry for name, entry in read_ledger(engine).items() if entry.state == "stored"}
    report.objects, report.size_bytes = len(stored), sum(entry.size_bytes for entry in stored.values())
    bad = list(bad_objects(engine, objects))
    known = {item.name for item in bad}
    for done, (name, entry) in enumerate(sorted(stored.items()) if deep else (), 1):
        found = unreadable(engine, objects, name, entry) if name not in known else None
        bad += [found] if found is not None else []
        on_object(done, len(stored))
    for item in bad:
        report.damage += _lost(engine, item)
    for item in orphans(engine, objects):
        (report.orphans if item.what == "orphan" else report.damage).extend(_lost(engine, item))
    with engine.transaction(write=False):
        robots = engine.fetch("SELECT robot, id FROM robots ORDER BY id")
    for number, robot_id in robots:
        streams, faults = stream_faults(engine, number)
        report.streams += streams
        report.damage += [_fault(engine, robot_id, fault) for fault in faults]
    for chunk in bad_chunks(engine) if deep else ():
        span = (chunk.first_ns, chunk.last_ns)
        report.damage.append(Damage("corrupt", chunk.detail, None, chunk.robot, chunk.series, *span))
    return report


def remember(engine: StoreEngine, report: Report) -> None:
    """Keep the report for whoever asks the gateway; inside a writing transaction of the caller's."""
    kept = {**asdict(report), "damage": [asdict(item) for item in (report.damage + report.orphans)[:KEPT]]}
    del kept["orphans"]
    put = "INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO UPDATE SET value = excluded.value"
    engine.execute(put, _KEY, orjson.dumps(kept).decode())


def last_report(engine: StoreEngine) -> Report | None:
    """The last report that was kept, inside a transaction of the caller's; orphans are among the damage."""
    rows = engine.fetch("SELECT value FROM meta WHERE key = ?", _KEY)
    if not rows:
        return None
    kept = orjson.loads(rows[0][0])
    return Report(**{**kept, "damage": [Damage(**item) for item in kept["damage"]]})


def delete_orphans(run: Transact, objects: ObjectStore, report: Report, *, now_ns: int) -> int:
    """Give the orphans of a report to the ledger, doomed, and sweep; how many objects went.

    Of the objects of others, outside of our folders, none is touched.
    """
    names = [item.object for item in report.orphans if item.object is not None and item.object.startswith(OURS)]
    doomed = (
        "INSERT INTO objects VALUES (?, 'orphan', 'doomed', 0, '', ?) ON CONFLICT (name) DO NOTHING"  # known meanwhile
    )
    run(lambda engine: engine.many(doomed, [(name, now_ns) for name in names]))
    gone = 0
    while count := sweep_objects(run, objects, now_ns=now_ns):
        gone += count
    return gone


def _lost(engine: StoreEngine, item: BadObject) -> Iterator[Damage]:
    """What a bad object held: a line for each topic."""
    with engine.transaction(write=False):
        rows = list(engine.fetch(_TOPICS, item.name)) or list(engine.fetch(_RECORDING, item.name))
    if not rows:
        yield Damage(item.what, item.detail, item.name)
    for robot_id, topic, first_ns, last_ns, count in rows:
        detail = f"{item.detail} ({count} messages)"
        yield Damage(item.what, detail, item.name, robot_id, topic, first_ns, last_ns)


def _fault(engine: StoreEngine, robot_id: str, fault: Fault) -> Damage:
    with engine.transaction(write=False):
        rows = engine.fetch("SELECT topic FROM channels WHERE channel = ?", fault.channel)
    said = {"hole": "neither stored nor declared lost", "twice": "there twice", "ahead": "past the watermark"}
    detail = f"numbers {fault.first_seq} to {fault.last_seq} are {said[fault.what]}"
    topic = rows[0][0] if rows else None
    return Damage(fault.what, detail, None, robot_id, topic, fault.first_ns, fault.last_ns)
