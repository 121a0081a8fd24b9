"""MCAP files of stored messages: whole, sorted, with their losses, and made with little memory."""

from __future__ import annotations

import io
import json
import tracemalloc
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import Channel as McapChannel

from gateway.errors import DamagedError, StoreError
from gateway.history import export as exports
from gateway.history.export import GAPS, Export, ExportRequest
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.samples import StoredBatch, StoredRun
from metaros.cli.bag.view import bag_facts, print_bag
from metaros.cli.shared.output import Output
from metaros.limits import Limits
from metaros.record import open_bag
from tests.gateway.history.source import EngineSource
from tests.gateway.store.samples import gap_write, run_write

BOTH = {"r1": ("/events", "/scan"), "r2": ("/events",)}


def commit(engine: StoreEngine) -> None:
    """r1 has /events and /scan, r2 /events, with stamps that lie between each other's."""
    writes = [
        run_write(1, [b"a%d" % n for n in range(40)], stamp_ns=1000),
        run_write(1, [b"s%d" % n for n in range(40)], stream_id=8, topic="/scan", stamp_ns=1020),
        run_write(1, [b"b%d" % n for n in range(40)], robot="r2", stamp_ns=990),
        gap_write(41, 50),
    ]
    Committer(engine).commit(writes, now_ns=1)


def made(export: Export) -> bytes:
    return b"".join(export.pieces())


def request(topics: dict[str, tuple[str, ...]] | None = None, **span: int) -> ExportRequest:
    return ExportRequest(topics=topics or BOTH, **{"start_ns": 0, "end_ns": 1 << 60, **span})


def messages(data: bytes) -> list[tuple[McapChannel, Any]]:
    return [(c, m) for _, c, m in make_reader(io.BytesIO(data), validate_crcs=True).iter_messages()]


def accounts(data: bytes) -> dict[str, Any]:
    (record,) = make_reader(io.BytesIO(data)).iter_metadata()
    assert record.name == GAPS
    return {key: json.loads(text) for key, text in record.metadata.items()}


def test_messages_of_two_robots_in_one_file(engine: StoreEngine, source: Callable[..., EngineSource]) -> None:
    commit(engine)
    data = made(Export(source(), request()))
    found = messages(data)
    assert [message.log_time for _, message in found] == sorted(message.log_time for _, message in found)
    by_topic: dict[str, list[bytes]] = {}
    for channel, message in found:
        by_topic.setdefault(channel.topic, []).append(message.data)
        assert message.publish_time == message.log_time
    assert by_topic == {
        "/r1/events": [b"a%d" % n for n in range(40)],
        "/scan": [b"s%d" % n for n in range(40)],
        "/r2/events": [b"b%d" % n for n in range(40)],
    }
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 120
    channels = {channel.topic: channel.metadata for channel in summary.channels.values()}
    assert (channels["/r2/events"]["robot"], channels["/r2/events"]["topic"]) == ("r2", "/events")
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}


def test_a_piece_of_time_and_of_topics(engine: StoreEngine, source: Callable[..., EngineSource]) -> None:
    commit(engine)
    data = made(Export(source(), request({"r1": ("/scan",)}, start_ns=1025, end_ns=1030)))
    assert [(channel.topic, message.log_time) for channel, message in messages(data)] == [
        ("/scan", stamp) for stamp in range(1025, 1031)
    ]


def test_losses_are_in_the_file(engine: StoreEngine) -> None:
    commit(engine)

    class Damaged(EngineSource):
        def load(self, run: StoredRun) -> StoredBatch:
            if run.channel.topic == "/scan":
                raise DamagedError("gone")
            return super().load(run)

    found = accounts(made(Export(Damaged(engine), request())))
    assert sorted(found) == ["/r1/events r1", "/r2/events r2", "/scan r1"]
    assert found["/r2/events r2"] == {"first": 1, "last": 40, "received": 40, "losses": []}
    (declared,) = found["/r1/events r1"]["losses"]
    assert (declared["count"], declared["reason"]) == (10, "outbox_full")
    (damaged,) = found["/scan r1"]["losses"]
    assert (damaged["count"], damaged["reason"], damaged["topic"]) == (40, "damaged", "/scan")


def test_bag_info_tells_the_losses(engine: StoreEngine, tmp_path: Path) -> None:
    commit(engine)
    path = tmp_path / "export.mcap"
    path.write_bytes(made(Export(EngineSource(engine), request())))
    facts = bag_facts(open_bag(path))
    assert {topic["topic"]: topic["missing"] for topic in facts["topics"]} == {
        "/r1/events": {"outbox_full": 10},
        "/r2/events": {},
        "/scan": {},
    }
    printed = io.StringIO()
    with redirect_stdout(printed):
        print_bag(Output(), facts, verbose=True)
    assert "10 on 1 topic: 10 outbox_full" in printed.getvalue()


def test_nothing_stored_is_a_sound_empty_file(engine: StoreEngine) -> None:
    data = made(Export(EngineSource(engine), request({"nobody": ()})))
    assert messages(data) == []
    assert accounts(data) == {}


def test_a_stopped_export_ends_at_once_and_has_no_end(engine: StoreEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exports, "CHUNK_BYTES", 50)
    commit(engine)
    export = Export(EngineSource(engine), request())
    pieces = export.pieces()
    begin = next(pieces) + next(pieces)
    export.stop()
    assert begin.startswith(b"\x89MCAP0\r\n")
    assert list(pieces) == []


def test_a_store_that_fails_fails_the_export(engine: StoreEngine) -> None:
    commit(engine)

    class Failing(EngineSource):
        def load(self, run: StoredRun) -> StoredBatch:
            if run.channel.topic == "/scan":
                raise StoreError("gone for a while")
            return super().load(run)

    with pytest.raises(StoreError):
        made(Export(Failing(engine), request()))


def test_memory_is_bounded_whatever_the_range(engine: StoreEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    """24 MiB of 24 topics at the same time, of which 4 MiB may be held, in chunks of 2 MiB."""
    monkeypatch.setattr(exports, "LIMITS", Limits(export_hold_bytes=4 << 20))
    committer = Committer(engine)
    topics = tuple(f"/t{number}" for number in range(24))
    content = [bytes([number]) * (1 << 17) for number in range(8)]
    for number, topic in enumerate(topics, 1):
        committer.commit([run_write(1, content, stream_id=number, topic=topic)], now_ns=1)
    export = Export(EngineSource(engine), request({"r1": topics}))
    size = 0
    tracemalloc.start()
    try:
        for piece in export.pieces():
            size += len(piece)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 16 << 20
    assert size > 1000
