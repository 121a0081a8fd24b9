"""The state of an instant: the newest message of each topic by then, and why a topic has none."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import orjson
import pytest

from gateway.domain.records import split_records
from gateway.errors import DamagedError
from gateway.history import snapshot as instants
from gateway.history.snapshot import pack_snapshot, read_snapshot
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.samples import StoredBatch, StoredRun
from metaros.limits import Limits
from tests.gateway.history.source import EngineSource
from tests.gateway.store.samples import channel, gap_write, run_write

SECOND = 10**9


def unpacked(data: bytes) -> tuple[dict[str, Any], list[tuple[int, int, bytes]]]:
    """The JSON, and (channel, stamp, payload) of the records, as a page of the dashboard reads them."""
    (length,) = struct.unpack_from("<I", data)
    records = [(number, record.stamp_ns, record.payload) for _, number, record in split_records(data[4 + length :])]
    return orjson.loads(data[4 : 4 + length]), records


def commit(engine: StoreEngine) -> None:
    """/events every second from 1 s to 20 s in two streams, a fresh one and a backfill that is older; /map once."""
    writes = [run_write(n, [b"%d" % (n + 10)], stamp_ns=(n + 10) * SECOND - n) for n in range(1, 11)]
    old = run_write(1, [b"%d" % n for n in range(1, 11)], stream_id=7 | 1 << 31, stamp_ns=0)
    old.run.columns.stamps_ns[:] = [n * SECOND for n in range(1, 11)]
    latched = run_write(1, [b"map"], stream_id=9, topic="/map", stamp_ns=0)
    object.__setattr__(latched.run.channel, "qos", ":1:,1:,:,:,,")
    Committer(engine).commit([*writes, old, latched], now_ns=1)


def test_the_newest_by_then(engine: StoreEngine, source: Callable[..., EngineSource]) -> None:
    commit(engine)
    at = source()
    for t_ns, payload in ((SECOND, b"1"), (5 * SECOND - 1, b"4"), (15 * SECOND, b"15"), (29 * SECOND, b"20")):
        snapshot = read_snapshot(at, "r1", ["/events", "/map"], t_ns=t_ns, max_age_ns=10 * SECOND)
        facts, records = unpacked(pack_snapshot(snapshot))
        assert [(number, content) for number, _, content in records] == [(1, payload), (2, b"map")]
        assert [row["topic"] for row in facts["channels"]] == ["/events", "/map"]
        assert facts["channels"][0]["channel"] == 1
        assert facts["channels"][0]["schema"] == channel().schema.decode()
        assert (facts["t_ms"], facts["missing"], facts["gaps"]) == (t_ns / 1e6, [], [])


def test_why_there_is_none(engine: StoreEngine, source: Callable[..., EngineSource]) -> None:
    commit(engine)
    Committer(engine).commit([gap_write(11, 14, stream_id=7), gap_write(1, 9, stream_id=8)], now_ns=1)
    now = source()
    late = read_snapshot(now, "r1", ["/events", "/map", "/none"], t_ns=31 * SECOND, max_age_ns=10 * SECOND)
    facts, records = unpacked(pack_snapshot(late))
    assert [content for _, _, content in records] == [b"map"]
    assert facts["missing"] == [
        {"topic": "/events", "reason": "too_old", "nearest_ms": 20_000.0},
        {"topic": "/none", "reason": "not_stored", "nearest_ms": None},
    ]
    early = read_snapshot(now, "r1", ["/events"], t_ns=2, max_age_ns=10)
    assert [item.reason for item in early.missing] == ["not_stored"]
    assert [(loss.count, loss.reason) for loss in early.losses] == [(4, "outbox_full")]


def test_an_answer_is_bounded(engine: StoreEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    commit(engine)
    monkeypatch.setattr(instants, "LIMITS", Limits(history_instant_bytes=3))
    snapshot = read_snapshot(EngineSource(engine), "r1", ["/events", "/map"], t_ns=20 * SECOND, max_age_ns=SECOND)
    assert [(item.topic, item.reason) for item in snapshot.missing] == [("/map", "too_large")]


def test_what_cannot_be_read_is_named_and_the_rest_is_there(engine: StoreEngine) -> None:
    commit(engine)

    class Damaged(EngineSource):
        def load(self, run: StoredRun) -> StoredBatch:
            if run.channel.topic == "/events":
                raise DamagedError("gone")
            return super().load(run)

    snapshot = read_snapshot(Damaged(engine), "r1", ["/events", "/map"], t_ns=20 * SECOND, max_age_ns=SECOND)
    assert [(item.topic, item.reason) for item in snapshot.missing] == [("/events", "damaged")]
    assert [message.payload for message in snapshot.messages] == [b"map"]
