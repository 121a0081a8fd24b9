"""A store that went back to its backup, and an agent that had let go what was stored since: the loss is declared."""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path

import numpy as np
import pytest

from gateway.backup.restore import restore
from gateway.backup.snapshot import open_existing
from gateway.backup.take import take
from gateway.store.objects import DirectoryStore
from gateway.store.telemetry.load import RunLoader
from metaros.clock import SystemClock
from tests.gateway.harness import client, running_gateway
from tests.gateway.store.samples import SampleFilter, read_samples
from tests.support.ports import free_port
from tests.support.robots.uplinks import feed, running, wait

MIB = 1 << 20
WORDS = ((b"kept", 20), (b"wait", 5), (b"late", 10))


def _back_up(folder: Path, backup: Path) -> None:
    engine = open_existing("", folder)
    given = {"where": "", "data_dir": folder, "with_master_key": True, "clock": SystemClock()}
    take(engine, DirectoryStore(folder / "objects"), backup, on_step=lambda *_: None, **given)
    engine.close()


def _restore(folder: Path, backup: Path) -> None:
    given = {"url": "", "data_dir": folder, "clock": SystemClock(), "who": "ada", "on_step": lambda *_: None}
    restore(backup, DirectoryStore(folder / "objects"), **given)


def _numbers(folder: Path) -> tuple[dict[int, dict[int, bytes]], list[tuple[int, int, int, str]], dict[int, int]]:
    """Of each of the robot's streams: the samples by their numbers, what is declared, and how far it is."""
    engine = open_existing("", folder)
    with engine.transaction(write=False):
        gaps = [tuple(row) for row in engine.fetch("SELECT stream_id, from_seq, to_seq, reason FROM gaps")]
        last = {row[0]: row[1] for row in engine.fetch("SELECT stream_id, seq FROM streams")}
        assert len(engine.fetch("SELECT DISTINCT epoch FROM streams")) == 1
    stored: dict[int, dict[int, bytes]] = {stream: {} for stream in last}
    loader = RunLoader(DirectoryStore(folder / "objects"))
    for batch in read_samples(engine, "r", SampleFilter(), limit=1000, loader=loader):
        ends, there = np.cumsum(batch.lengths), stored[batch.stream_id]
        for place, (end, length) in enumerate(zip(ends, batch.lengths, strict=True)):
            assert batch.first_seq + place not in there
            there[batch.first_seq + place] = batch.payload[end - length : end][:10]
    engine.close()
    return stored, gaps, last


@pytest.mark.integration
async def test_the_gap_is_declared_and_nothing_else_is_lost(tmp_path: Path) -> None:
    """What fills whole files of the outbox is deleted there once it is acknowledged: only that is lost."""
    data, port = tmp_path / "data", free_port()
    async with running(f"grpc://127.0.0.1:{port}") as (owner, uplink):
        async with running_gateway(tmp_path, grpc_port=port):
            await wait(lambda: owner.ups)
            feed(owner, uplink, [b"kept %5d" % n for n in range(20)])
            await wait(lambda: not owner.held)
            await asyncio.to_thread(_back_up, data, tmp_path / "backup")
            for n in range(40):
                feed(owner, uplink, [b"then %5d" % n + bytes(MIB)])
                await wait(lambda: owner.held < 8)
            await wait(lambda: not owner.held)
        feed(owner, uplink, [b"wait %5d" % n for n in range(5)])
        shutil.rmtree(data)
        await asyncio.to_thread(_restore, data, tmp_path / "backup")
        ups = owner.ups
        async with running_gateway(tmp_path, grpc_port=port) as ready:
            await wait(lambda: owner.ups > ups)
            feed(owner, uplink, [b"late %5d" % n for n in range(10)])
            await wait(lambda: not owner.held)
            admin = (ready.data_dir / "local.key").read_text().strip()
            async with client(ready, key=admin) as http:
                (shown,) = (await http.get("/api/v1/robots/r/gaps")).json()["gaps"]
                assert (await http.get("/api/v1/alerts")).json()["alerts"] == []
    stored, gaps, last = _numbers(data)
    (gap,) = gaps
    fresh, begin, end, reason = gap
    assert (begin, reason, shown["reason"]) == (21, "not_held", "not_held")
    assert 21 < end < 60, "of forty samples in files of sixteen, some were still there"
    lost = range(begin, end + 1)
    for stream, there in stored.items():
        declared = lost if stream == fresh else ()
        assert sorted([*there, *declared]) == list(range(1, last[stream] + 1)), stream
    texts = sorted(text for there in stored.values() for text in there.values())
    then = [b"then %5d" % (number - 21) for number in range(end + 1, 61)]
    kept, waited, late = ([b"%s %5d" % (word, n) for n in range(count)] for word, count in WORDS)
    assert texts == sorted([*kept, *then, *waited, *late])
