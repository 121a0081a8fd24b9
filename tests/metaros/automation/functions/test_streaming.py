"""Answers that come piece by piece: of generator handlers, on our client."""

from __future__ import annotations

import asyncio
import dataclasses
import json
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio

from metaros.automation.functions.calls import Invocation, Outcome
from metaros.limits import LIMITS
from tests.support.functions.functions import Bench, running_engine
from tests.support.waiting import wait_until_async

pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def bench(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Bench]:
    limits = dataclasses.replace(LIMITS, function_stream_bytes=25_000_000, function_stream_burst_bytes=64_000_000)
    async with running_engine(tmp_path_factory.mktemp("bench"), limits=limits) as bench:
        yield bench


async def test_pieces_come_as_they_are_made(bench: Bench) -> None:
    source = """
import os, time
def handler(event, context):
    yield "one"
    while not os.path.exists(event): time.sleep(0.01)
    yield b"two"
"""
    go_on = bench.shared / "go-on"
    call = Invocation(request_id="r", payload=json.dumps(str(go_on)).encode())
    pieces = bench.engine.stream(bench.spec(source), call)
    assert await anext(pieces) == b"one"
    go_on.touch()
    assert await anext(pieces) == b"two"
    outcome = await anext(pieces)
    assert isinstance(outcome, Outcome)
    assert (outcome.ok, outcome.payload, outcome.content_type) == (True, b"", "application/octet-stream")
    with pytest.raises(StopAsyncIteration):
        await anext(pieces)


async def test_an_error_in_mid_stream(bench: Bench) -> None:
    pieces, outcome = await bench.stream(
        bench.spec("def handler(e, c):\n    yield 'half'\n    raise ValueError('w')\n")
    )
    assert pieces == b"half"
    assert outcome.error_type == "ValueError"
    document = json.loads(outcome.payload)
    assert (document["errorMessage"], document["requestId"][:8]) == ("w", "request-")
    assert b"[ERROR] ValueError: w" in outcome.log


async def test_an_error_before_the_first_piece_is_an_error_of_the_call(bench: Bench) -> None:
    spec = bench.spec("def handler(e, c):\n    raise ValueError('w')\n    yield 'never'\n")
    pieces, outcome = await bench.stream(spec)
    assert (pieces, outcome.error_type) == (b"", "ValueError")


async def test_a_piece_of_another_kind(bench: Bench) -> None:
    pieces, outcome = await bench.stream(bench.spec("def handler(e, c):\n    yield 'a'\n    yield 5\n"))
    assert (pieces, outcome.error_type) == (b"a", "Runtime.MarshalError")


async def test_who_ends_in_mid_stream(bench: Bench) -> None:
    spec = bench.spec("import os\ndef handler(e, c):\n    yield 'a'\n    os._exit(9)\n")
    pieces, outcome = await bench.stream(spec)
    assert pieces == b"a"
    assert outcome.error_type in ("Runtime.ExitError", "Runtime.TruncatedResponse")


async def test_who_is_too_slow(bench: Bench) -> None:
    spec = bench.spec("import time\ndef handler(e, c):\n    yield 'a'\n    time.sleep(60)\n", timeout_s=0.5)
    pieces, outcome = await bench.stream(spec)
    assert (pieces, outcome.error_type) == (b"a", "Sandbox.Timeout")


async def test_asked_for_at_once_a_stream_comes_whole(bench: Bench) -> None:
    spec = bench.spec("def handler(e, c):\n    for i in range(3): yield str(i)\n")
    assert (await bench.invoke(spec)).payload == b"012"


async def test_more_than_an_answer_at_once_may_have(bench: Bench) -> None:
    spec = bench.spec("def handler(e, c):\n    for i in range(80): yield b'x' * 100_000\n")
    pieces, outcome = await bench.stream(spec)
    assert (len(pieces), outcome.ok) == (8_000_000, True)
    assert (await bench.invoke(spec)).error_type == "Function.ResponseSizeTooLarge"


async def test_a_stream_over_its_limit(bench: Bench) -> None:
    spec = bench.spec("def handler(e, c):\n    for i in range(300): yield b'x' * 100_000\n")
    pieces, outcome = await bench.stream(spec)
    assert outcome.error_type == "Function.ResponseSizeTooLarge"
    assert len(pieces) <= 25_000_000
    assert (await bench.invoke(bench.spec("def handler(e, c): return 1"))).payload == b"1"


async def test_a_reader_that_waits_lets_the_function_wait(bench: Bench) -> None:
    source = """
def handler(path, context):
    for i in range(200):
        yield b"x" * 100_000
        with open(path, "w") as f: f.write(str(i))
"""
    reported = bench.shared / "pieces"
    reported.touch()
    reported.chmod(0o666)
    pieces = bench.engine.stream(
        bench.spec(source), Invocation(request_id="r", payload=json.dumps(str(reported)).encode())
    )
    size = len(await anext(pieces))
    await wait_until_async(lambda: reported.read_text() not in ("", "0"))
    await asyncio.sleep(0.2)  # what could come in this time and does not
    assert int(reported.read_text() or 0) < 199  # what sockets hold is less
    async for piece in pieces:
        size += len(piece) if isinstance(piece, bytes) else 0
    assert size == 20_000_000


async def test_a_reader_that_leaves_stops_nothing(bench: Bench) -> None:
    source = """
def handler(path, context):
    for i in range(80): yield b"x" * 100_000
    with open(path, "w") as f: f.write("done")
"""
    reported = bench.shared / "told"
    reported.touch()
    reported.chmod(0o666)
    spec = bench.spec(source)
    pieces = bench.engine.stream(spec, Invocation(request_id="r", payload=json.dumps(str(reported)).encode()))
    await anext(pieces)
    await pieces.aclose()
    await wait_until_async(lambda: reported.read_text() == "done")
    await wait_until_async(lambda: not bench.pool(spec).busy)
