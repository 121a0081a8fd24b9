"""A worker's log: messages keep their bounds, calls get their own, and nobody's log is without a bound."""

from __future__ import annotations

import asyncio
import dataclasses
import os
from pathlib import Path

import pytest

from metaros.automation.functions.calls import FunctionSpec
from metaros.automation.functions.log_pump import LogPump, ThreadPump
from metaros.automation.functions.logs import FrameReader, LineReader, LogPiece, WorkerLog
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.support.tables import cases
from tests.support.waiting import wait_until_async

SPEC = FunctionSpec(key="k", name="f", version="3", arn="arn", handler="a.b", code_dir=Path())
LIMITED = dataclasses.replace(
    LIMITS, function_call_log_bytes=100, function_tail_bytes=40, function_log_message_bytes=30
)


def frame(message: bytes, kind: int = 0xA55A0003) -> bytes:
    return kind.to_bytes(4, "big") + len(message).to_bytes(4, "big") + bytes(8) + message


@cases("size", [1, 5, 16, 1000])
def test_frames_in_pieces_of_any_size(size: int) -> None:
    reader = FrameReader(30)
    data = frame(b"two\nlines\n") + frame(b"no end", 0xA55A0017) + frame(b"x" * 50) + frame(b"") + frame(b"last")
    found = [m for at in range(0, len(data), size) for m in reader.feed(data[at : at + size])]
    assert found == [b"two\nlines\n", b"no end\n", b"x" * 30 + b"\n", b"\n", b"last\n"]


def test_a_frame_that_claims_gibibytes_is_held_in_none_of_them() -> None:
    reader = FrameReader(30)
    head = (0xA55A0003).to_bytes(4, "big") + (1 << 31).to_bytes(4, "big") + bytes(8)
    assert reader.feed(head + b"x" * 40) == [b"x" * 30 + b"\n"]
    for _ in range(100):
        assert reader.feed(b"y" * 1000) == []


def test_what_is_no_frame_is_passed_on() -> None:
    reader = FrameReader(30)
    assert reader.feed(frame(b"good") + b"nonsense of a handler") == [b"good\n", b"nonsense of a handler"]
    assert reader.feed(b"more") == [b"more"]


def test_lines() -> None:
    reader = LineReader(10)
    assert reader.feed(b"a\nb") == b"a\n"
    assert reader.feed(b"c\n") == b"bc\n"
    assert reader.feed(b"x" * 11) == b"x" * 11 + b"\n"
    assert reader.feed(b"d") == b""
    assert reader.flush() == b"d\n"
    assert reader.flush() == b""


def log_and_pieces() -> tuple[WorkerLog, list[LogPiece]]:
    pieces: list[LogPiece] = []
    return WorkerLog(SPEC, "w", emit=pieces.append, clock=ManualClock(wall_ns=5), limits=LIMITED), pieces


def test_each_call_has_its_own() -> None:
    log, pieces = log_and_pieces()
    log.plain(b"at init\n")
    log.begin("r1")
    log.plain(b"one\nunfin")
    assert log.end("END\n") == b"at init\nSTART RequestId: r1 Version: 3\none\nunfin\nEND\n"[-40:]
    log.plain(b"between\n")
    log.begin("r2")
    log.framed(frame(b"two"))
    log.end("END\n")
    assert [(p.request_id, p.text) for p in pieces] == [
        ("", "at init\n"),
        ("r1", "START RequestId: r1 Version: 3\none\n"),
        ("r1", "unfin\nEND\n"),
        ("", "between\n"),
        ("r2", "START RequestId: r2 Version: 3\ntwo\n"),
        ("r2", "END\n"),
    ]
    assert pieces[0] == LogPiece("f", "3", "k", "w", "", 5, "at init\n")


def test_a_call_that_writes_nothing_is_reported_in_one_piece() -> None:
    log, pieces = log_and_pieces()
    log.begin("r1")
    log.end("END\n")
    assert [p.text for p in pieces] == ["START RequestId: r1 Version: 3\nEND\n"]


def test_a_log_over_its_limit() -> None:
    log, pieces = log_and_pieces()
    log.begin("r1")
    for n in range(50):
        log.plain(b"line %02d\n" % n)
    tail = log.end("END\n")
    text = "".join(p.text for p in pieces)
    assert text.count("line") == 12
    assert text.count("over 100 bytes: the rest is dropped") == 1
    assert tail.endswith(b"dropped]\nEND\n")
    log.begin("r2")
    log.plain(b"again\n")
    assert pieces[-1].text.endswith("again\n")


def test_no_utf_8() -> None:
    log, pieces = log_and_pieces()
    log.plain(b"\xff\n")
    assert pieces[0].text == "\ufffd\n"


@pytest.fixture
def pipe() -> tuple[int, int]:
    return os.pipe()


async def test_what_was_written_is_there_at_once(pipe: tuple[int, int]) -> None:
    out, into = pipe
    os.set_blocking(out, False)
    seen = bytearray()
    pump = LogPump(asyncio.get_running_loop(), {out: seen.extend}, bytes_per_s=1_000_000)
    os.write(into, b"abc")
    pump.drain()
    assert seen == b"abc"
    os.close(into)
    pump.drain()
    pump.close()
    os.close(out)


async def test_who_goes_on_writing_is_not_read_for_ever(pipe: tuple[int, int]) -> None:
    """What it wrote before now is in the pipe, and that is all that is waited for."""
    out, into = pipe
    os.set_blocking(out, False)
    seen = bytearray()

    def take(data: bytes) -> None:
        seen.extend(data)
        os.write(into, b"x" * 1000)

    pump = LogPump(asyncio.get_running_loop(), {out: take}, bytes_per_s=1_000_000)
    os.write(into, b"x" * 1000)
    pump.drain()
    assert 1000 <= len(seen) < 10_000
    pump.close()
    os.close(into)
    os.close(out)


def test_frames_of_no_size_are_one_piece() -> None:
    """A piece is told to all who listen: thousands of them in one read would be a burden."""
    log, pieces = log_and_pieces()
    log.begin("r1")
    log.framed(frame(b"") * 50)
    assert len(pieces) == 1


async def test_who_writes_too_fast_waits(pipe: tuple[int, int]) -> None:
    out, into = pipe
    os.set_blocking(out, False)
    os.set_blocking(into, False)
    seen = bytearray()
    pump = LogPump(asyncio.get_running_loop(), {out: seen.extend}, bytes_per_s=100_000)
    written = 0
    for _ in range(20):
        try:
            written += os.write(into, b"x" * 30_000)
        except BlockingIOError:
            break
        pump.drain()
    assert written < 600_000, "the pipe is full: the writer waits"
    assert len(seen) < 300_000
    await wait_until_async(lambda: len(seen) == written)
    pump.close()
    os.close(out)
    os.close(into)


async def test_a_thread_where_no_loop_reads_pipes(pipe: tuple[int, int]) -> None:
    out, into = pipe
    seen = bytearray()
    pump = ThreadPump(asyncio.get_running_loop(), {out: seen.extend}, bytes_per_s=10_000_000)
    os.write(into, b"abc")
    await wait_until_async(lambda: seen == b"abc")
    pump.drain()
    pump.close()
    os.close(into)
    os.close(out)
