"""Streamed answers: their pace, what waits for a reader, and readers that are gone."""

from __future__ import annotations

import asyncio
import dataclasses
from collections.abc import AsyncIterator

import pytest

from metaros.automation.functions.calls import Outcome
from metaros.automation.functions.errors import EngineClosedError
from metaros.automation.functions.response_stream import ResponseStream
from metaros.limits import LIMITS
from tests.support.waiting import wait_until_async

LIMITED = dataclasses.replace(
    LIMITS,
    function_stream_bytes=1000,
    function_stream_window_bytes=100,
    function_stream_burst_bytes=300,
    function_stream_bytes_per_s=1000,
)


class Source:
    """A connection: whether it is read."""

    def __init__(self) -> None:
        self.reads = True

    def pause_reading(self) -> None:
        assert self.reads
        self.reads = False

    def resume_reading(self) -> None:
        assert not self.reads
        self.reads = True


@pytest.fixture
async def stream() -> AsyncIterator[ResponseStream]:
    stream = ResponseStream(asyncio.get_running_loop(), limits=LIMITED)
    yield stream
    stream.end(Outcome(payload=b""))


async def test_the_source_waits_for_the_reader(stream: ResponseStream) -> None:
    source = Source()
    stream.begin(source)
    stream.feed(b"x" * 99)
    assert source.reads
    stream.feed(b"y")
    assert not source.reads
    assert await anext(stream) == b"x" * 99
    assert source.reads


async def test_the_pace(stream: ResponseStream) -> None:
    source = Source()
    stream.begin(source)
    for _ in range(4):
        stream.feed(b"x" * 90)
        await anext(stream)
    assert not source.reads, "360 bytes at once, of 300"
    await wait_until_async(lambda: source.reads)


async def test_a_reader_that_waits_is_woken(stream: ResponseStream) -> None:
    waiting = asyncio.create_task(anext(stream))
    await asyncio.sleep(0)
    stream.feed(b"")
    stream.feed(b"a")
    assert await waiting == b"a"
    outcome = Outcome(payload=b"", error_type="E")
    waiting = asyncio.create_task(anext(stream))
    await asyncio.sleep(0)
    stream.end(outcome)
    assert await waiting is outcome
    with pytest.raises(StopAsyncIteration):
        await anext(stream)


async def test_what_is_over_the_limit_is_dropped(stream: ResponseStream) -> None:
    stream.feed(b"x" * 1000)
    assert not stream.too_large
    stream.feed(b"y")
    assert stream.too_large
    stream.end(Outcome(payload=b""))
    assert [len(piece) async for piece in stream if isinstance(piece, bytes)] == [1000]


async def test_a_reader_that_left_holds_nothing_up(stream: ResponseStream) -> None:
    source = Source()
    stream.begin(source)
    stream.feed(b"x" * 200)
    assert not source.reads
    stream.discard()
    assert source.reads
    stream.feed(b"x" * 200)
    assert source.reads


async def test_an_engine_that_closes_is_reported(stream: ResponseStream) -> None:
    stream.feed(b"a")
    stream.fail(EngineClosedError("closed"))
    assert await anext(stream) == b"a"
    with pytest.raises(EngineClosedError):
        await anext(stream)
